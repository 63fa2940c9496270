"""Phrases of the project's former dialect do not come back: what is read uses the field's terms."""

import ast
import io
import re
import tokenize
from functools import cache

import pytest

from tests.docs import pages

RETIRED = {
    "own steps": "steps of the method, or adaptive step size",
    "steps of one length": "fixed step size",
    "steps that vary": "adaptive step size",
    "steps of varying length": "adaptive step size",
    "throw-away": "partial step that is discarded",
    "steps? (taken )?aside": "partial step",
    "seed paper": "the original paper",
    "home ground": "intended regime",
    "evaluations are dear": "expensive right-hand side",
    "no thinking": "default",
    "true motion": "reference solution",
    "true trajectory": "reference solution",
    "sham rotation(?!”)": "spurious precession",  # in quotes it is the paper's own term
    "way back to the start": "time-reversal error",
    "laws? of (the |an? )?(energy's )?drifts?": "error growth",
    "walks? at random": "performs a random walk",
    "(?<!random )walks? of the energy": "random walk of the energy error",
    "trajectories part": "diverge",
    "(is|are|was|were|be) void": "is excluded, with the reason",
    "matter of luck": "random",
    "must hold exactly": "exact relations",
    "keeps? the (energy|angular momentum|invariants?)": "conserves the energy",
    "energy is (not )?kept": "the energy is conserved",
    "does not care": "does not conserve",
    "damp nothing": "are not L-stable",
    "seen by nobody": "missed by every method",
    "lanes of the vector unit": "SIMD lanes",
    "(with )?the same bits": "bitwise identical",
    "span of time": "integration interval",
    r"whole span(?! \\?\(t)": "integration interval",  # stored references tell theirs so
    "our (own )?(methods|settings|kernel|side)": "HBVM and Gauss",
    "our (intervals?|exponents?|trajector(y|ies)|adapters?)": "those of HBVM, or the computed ones",
    "(as|than) ours": "those of HBVM and Gauss",
    "ours, theirs(?! :)": "the libraries' names",
    "ours beside": "HBVM and Gauss beside",
    "times as long as our": "time relative to",
    "how many times as long as": "run time relative to",
    "times the best": "× slower, or × larger",
    "right to 1e-": "position error ≤",
    "fixed computation": "calibration loop",
    "stolen time": "steal time",
    "the host kept": "steal time",
    "bits wide": "n-bit vector arithmetic",
    "in truth": "reference solution",
    "what is left of (a|the) change(?!s)": "residual of the iteration",
    "contraction seen": "convergence rate",
    "handovers?": "solver switch",
    "over the starts": "over the initial conditions",
    "witnesses": "reference subset",
    "kept runs?": "archive",
    "duels?": "head-to-head",
    "on the front": "on the Pareto front",
    "(full|empty) mark(er)?s?": "filled or open marker",
    "starts know": "16 samples: ±20 %",
    "(is|are) known to ±": "has an uncertainty of ±",
    "chance puts": "by chance in … % of all runs",
    "digits? for sure": "reliable digits",
    "first result soon": "short compilation",
    "everything, for programs": "JSON output",
    "the one that got further": "keep the most complete duplicate",
    "say what can be": "analyse",
    "distance of the samples": "output interval",
    "what a time is worth": "interpreting timings",
    "corners that no table": "other discontinuities",
    "give it a name": "registering it",
}
OUTSIDE_THE_KERNEL = {
    "(tells?|prints?) the essential": "shows a summary",
    r"(several|few|neighbouring|perturbed|sixteen|\d+) starts": "initial conditions",
    "read off": "computed from, or derived from",
    "what came out": "the results",
    "the other way about": "the reverse",
    "iterations a step": "iterations per step",
    "evaluations a step": "evaluations per step",
    "field evaluations": "right-hand-side evaluations",
    "made anew": "new",
    "energy leaks?": "energy drift",
    "damps nothing": "is not L-stable",
    "keeps? (every |all )?quadratic": "conserves quadratic invariants",
    "kept by the flow": "conserved",
    "not to be had": "not available",
    "chooses? everything itself": "chooses its order and step size automatically",
    "last own step": "end of the last step",
    "stepped over": "missed",
    "one of our errors": "an error of HBVM()",
    "begin at the beginning": "start from the beginning",
    "while they serve": "as long as it converges",
    "of one's own": "your own",
    "at (its|their) strictest": "at its tightest tolerance",
    "digits are sure": "reliable digits",
    "half axis": "semi-major axis",
    "true place": "reference solution",
    "the very same": "bitwise identical",
    "(is|are) put right": "is corrected by the projection",
    "goe?s? one by one": "are integrated one after another",
    "what decays fast": "fast transients",
    "knows? no average": "involves no averaging",
    "position right": "position error",
    "processor's time": "CPU time",
}
"""The same, for all but the sources of the kernel."""

WRITTEN = [
    path for path in pages.sources() if path.name not in ("kernel.md", "CONTRIBUTING.md")
]  # those two are written for developers
KERNEL = pages.ROOT / "integrators" / "kernel"
PACKAGES = ("problems", "integrators", "hbvm_bench")
SOURCES = [
    path
    for package in PACKAGES
    for pattern in ("*.py", "*.toml", "*.j2", "*.js")
    for path in sorted((pages.ROOT / package).rglob(pattern))
]
DRAWN = sorted((pages.ROOT / "reports").rglob("*.md")) + sorted((pages.ROOT / "reports").rglob("*.svg"))


@cache
def any_of(phrases: tuple[str, ...]) -> re.Pattern[str]:
    """Return a pattern of all phrases, which passes over a text once."""
    return re.compile(rf"\b(?:{'|'.join(phrases)})")


def retired(text: str, phrases: dict[str, str] = RETIRED | OUTSIDE_THE_KERNEL) -> dict[str, str]:
    """Return the retired phrases in a text, with the field's terms for them."""
    joined = " ".join(re.sub(r"`[^`\n]*`|<[^<>]*>", "", text).lower().split())
    if not any_of(tuple(phrases)).search(joined):
        return {}
    return {phrase: term for phrase, term in phrases.items() if re.search(rf"\b{phrase}", joined)}


def read(source: str) -> str:
    """Return what readers see of a Python file: its strings, joined where they are, and its comments."""
    strings = (
        "".join(part.value for part in node.values if isinstance(part, ast.Constant))
        if isinstance(node, ast.JoinedStr)
        else node.value
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))
    )
    comments = " ".join(
        token.string.lstrip("# ")
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT
    )
    return " | ".join([*map(str, strings), comments])


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: str(page.relative_to(pages.ROOT)))
def test_a_page_uses_the_terms_of_the_field(page):
    assert retired(page.read_text(encoding="utf-8")) == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_the_code_speaks_the_terms_of_the_field(package):
    """Docstrings, comments, help texts, sentences of reports, labels of figures and campaigns."""
    found = {}
    for path in SOURCES:
        if (pages.ROOT / package) in path.parents:
            text = path.read_text(encoding="utf-8")
            phrases = RETIRED | ({} if KERNEL in path.parents else OUTSIDE_THE_KERNEL)
            said = retired(read(text) if path.suffix == ".py" else text.replace("\n#", "\n"), phrases)
            found |= {str(path.relative_to(pages.ROOT)): said} if said else {}
    assert found == {}


def test_drawn_reports_use_the_terms_of_the_field():
    said = {str(path.relative_to(pages.ROOT)): retired(path.read_text(encoding="utf-8")) for path in DRAWN}
    assert {path: words for path, words in said.items() if words} == {}


@pytest.mark.parametrize(
    ("text", "phrases"),
    [
        ("The method's own\nsteps", {"own steps"}),
        ("keeps the energy", {"keeps? the (energy|angular momentum|invariants?)"}),
        ("the wave equation's span of modes; vector fields; peers; a symmetry guard", set()),
        ("`seed paper` in code", set()),
        ("a spurious precession (the paper's “sham rotation”)", set()),
        ("a random walk of the energy error", set()),
        (
            "sixteen starts, read off",
            {r"(several|few|neighbouring|perturbed|sixteen|\d+) starts", "read off"},
        ),
    ],
)
def test_good_words_are_no_false_alarm(text, phrases):
    assert retired(text).keys() == phrases
