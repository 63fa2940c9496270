"""The pages on problems and engines, from the problems' own docstrings, formulas and data."""

import inspect
import re
from collections.abc import Sequence
from pathlib import Path
from textwrap import dedent

import problems
from docs.problem_pages import pictures
from hbvm_bench.reference import solutions as reference
from hbvm_bench.report.markdown import printed
from hbvm_bench.store.files import write_all
from hbvm_bench.summaries import findings
from problems import registry
from problems.analysis import structure
from problems.errors import InputError
from problems.problem import Problem
from problems.targets.latex import latex

BEGIN, END = "<!-- made by: python -m docs.problem_pages -->", "<!-- end of what is made -->"
"""Between them stands what is made; all else on a page is written by hand and stays."""


def write(directory: Path, *, with_pictures: bool = True) -> list[Path]:
    """Write a page and a picture of each problem, and the generated parts of the overviews, into a directory.

    These are ``problems/NAME.md``, ``problems/NAME.svg``, ``problems.md`` and ``engines.md``.

    Raises
    ------
    problems.errors.InputError
        If a page there has not the places for what is made.
    """
    entries = {name: registry.entry(name) for name in registry.built_in()}
    drawn = {name: entry.picture for name, entry in entries.items() if entry and entry.picture}
    names = [name for name, picture in drawn.items() if not picture.arguments]
    loaded = {name: problems.load(name) for name in names}
    pages = {"problems.md": [_overview(loaded), _references()], "engines.md": [_engines(names)]}
    files = {directory / name: _filled(directory / name, pieces).encode() for name, pieces in pages.items()}
    files |= {
        directory / "problems" / f"{name}.md": _page(name, problem).encode()
        for name, problem in loaded.items()
    }
    for name in drawn if with_pictures else ():
        files[directory / "problems" / f"{name}.svg"] = pictures.draw(name).encode()
    write_all(files)
    return list(files)


def _filled(path: Path, pieces: Sequence[str]) -> str:
    """Return a page with new pieces between its marks; one that is not there yet has nothing else."""
    blocks = [f"{BEGIN}\n\n{piece.strip()}\n\n{END}" for piece in pieces]
    if not path.is_file():
        return "\n\n".join(blocks) + "\n"
    marked = f"(?s){re.escape(BEGIN)}.*?{re.escape(END)}"
    kept = re.split(marked, path.read_text(encoding="utf-8"))
    if len(kept) != len(pieces) + 1:
        raise InputError(
            f"{path} must have {BEGIN!r} and {END!r} around {len(pieces)} places, not {len(kept) - 1}."
        )
    return kept[0] + "".join(piece + after for piece, after in zip(blocks, kept[1:], strict=True))


def _engines(names: Sequence[str]) -> str:
    table, reasons = findings.engines(names, any_processor=True)
    listed = "\n".join(f"{i}. {reason}" for i, reason in enumerate(reasons, start=1))
    return f"{printed(table)}\n\n{listed}"


def _overview(loaded: dict[str, Problem]) -> str:
    lines = [
        "| problem | unknowns | separable | polynomial | invariants | what it tests |",
        "|---|---|---|---|---|---|",
    ]
    for name, problem in loaded.items():
        system = problem.system
        degree = structure.degree(system, problem.par)
        lines.append(
            f"| [{name}](problems/{name}.md) | {system.dim} | {'yes' if system.separable else 'no'} | "
            f"{'no' if degree is None else f'degree {degree}'} | "
            f"{', '.join(system.invariants).replace('_', ' ')} | {problem.notes} |"
        )
    contents = "\n".join(f"problems/{name}" for name in loaded)
    return "\n".join([*lines, "", f"```{{toctree}}\n:hidden:\n\n{contents}\n```"])


def _page(name: str, problem: Problem) -> str:
    sections = _numpydoc(inspect.getdoc(registry.factory(name)) or "")
    summary = _flowed(sections.get("Summary", "")).removeprefix("Return ")
    arguments, returns = (_entries(sections.get(key, "")) for key in ("Parameters", "Returns"))
    guards = ", ".join(problem.system.guards).replace("_", " ")
    lines = [
        f"# {name}\n",
        f"![{problem.title}]({name}.svg)\n",
        f"{summary[:1].upper()}{summary[1:]}\n",
        f"$$H = {latex(problem.system)}$$\n",
        f"`{problem!r}`, t from {problem.t0:g} to {problem.t_end:g}.\n",
        *(f"- `{head}`{_defaults(name, head)}: {body}" for head, body in arguments),
        *(f"- returns: {body}" for _, body in returns[:1]),
        *([f"- exactly 0 by symmetry: {guards}"] if guards else []),
        *(f"- source: {source}" for source in problem.references),
    ]
    return "\n".join(lines) + "\n"


def _defaults(name: str, head: str) -> str:
    """Return the defaults of the parameters that ``head`` names, such as ``"q1, q2 : float"``."""
    signature = inspect.signature(registry.factory(name)).parameters
    values = [signature[one.strip()].default for one in head.partition(":")[0].split(",")]
    shown = [f"{value:.7g}" if isinstance(value, float) else repr(value) for value in values]
    return f", default {', '.join(shown)}" if values != [None] else ""


def _numpydoc(doc: str) -> dict[str, str]:
    """Split a docstring into its sections."""
    sections = {"Summary": ""}
    heading = "Summary"
    lines = doc.splitlines()
    for i, line in enumerate(lines):
        below = lines[i + 1] if i + 1 < len(lines) else ""
        if line and below and set(below) == {"-"}:
            heading = line
            sections[heading] = ""
        elif not (line and set(line) == {"-"}):
            sections[heading] += line + "\n"
    return sections


def _entries(section: str) -> list[tuple[str, str]]:
    """Return the (name and type, description) pairs of a section."""
    entries: list[tuple[str, str]] = []
    for line in section.splitlines():
        if line and not line.startswith(" "):
            entries.append((line, ""))
        elif line.strip() and entries:
            head, body = entries[-1]
            entries[-1] = (head, f"{body} {line.strip()}".strip())
    return [(head, _code(body)) for head, body in entries]


def _flowed(block: str) -> str:
    """Return paragraphs on one line each; indented formulas stay as they are."""
    paragraphs = re.split(r"\n\s*\n", block.strip("\n"))
    return "\n\n".join(
        f"```\n{dedent(part)}\n```" if part.startswith("    ") else _code(" ".join(part.split()))
        for part in paragraphs
    )


def _code(body: str) -> str:
    return body.replace("``", "`")


def _references() -> str:
    lines = ["| problem | up to t = | the two differ by (relative) |", "|---|---|---|"]
    for path in sorted(reference.folder().glob("*.json")):
        stored = reference.read(path)
        agreement = str(stored.provenance.get("agreement", "")).split(" ")[0]
        lines.append(f"| `{stored.problem}` | {float.fromhex(stored.t[-1]):g} | {agreement} |")
    return "\n".join(lines)
