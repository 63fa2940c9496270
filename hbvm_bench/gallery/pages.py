"""docs/problems.md, written from the problems' own words, formulas and data."""

import inspect
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import problems
from hbvm_bench.gallery import pictures
from hbvm_bench.reference import solutions as reference
from hbvm_bench.report.markdown import printed
from hbvm_bench.store.files import write_all
from hbvm_bench.summaries import engines
from problems import registry
from problems.analysis import structure
from problems.analysis.latex import latex
from problems.problem import Problem

HEAD = """<!-- made by: hbvm-bench gallery docs -->
# Problems

Each problem is a function that returns a `problems.Problem`: a system written once, a start, parameters and
a span. On the command line and in campaigns it is written as it prints, `kepler(e=0.9)`. This page is made by
code (`hbvm-bench gallery docs`) from the problems themselves; formulas are printed from the traced
expressions, with indices that count from 1. Which engine takes which problem: [engines](engines.md); how long
large systems take to compile: [compile times](compile_times.md).

"""

OWN = """## A system of your own

![a quartic oscillator, given as text](problems/expression.svg)

As text, on the command line or in a campaign file. It is parsed by a whitelist and never evaluated:

```sh
hbvm-bench inspect "p^2/2 - cos(q)"
hbvm-bench inspect "(p1^2 + p2^2)/(2*m) + k*q1^2*q2" --par "k=2, m=0.5"
hbvm-bench run -p 'expression(H="p^2/2 + k*q^4/4", q0=[1.0], p0=[0.0], parameters="k=2")' \\
    -m "HBVM(k=4, s=2, h=0.1)"
```

Names are `q, p` for one degree of freedom, `q1, p1, q2, ...` for more, `t`, `pi`, and parameters; `^` or `**`
with an integer or half-integer exponent; sqrt, sin, cos, tan, exp, log, abs.

In Python, where sums over many bodies or neighbours are declared with `m.sum` and become loops:

```python
import integrators
import problems

n = 1000


def H(q, p, par, m):
    kinetic = m.sum(lambda i: p[i] ** 2 / 2, range(n))
    springs = m.sum(lambda i, j: (q[j] - q[i]) ** 2 / 2 + par.beta * (q[j] - q[i]) ** 4 / 4,
                    [(i, (i + 1) % n) for i in range(n)])
    return kinetic + springs


ring = problems.Hamiltonian(H, dof=n, parameters={"beta": 1.0})
problem = problems.Problem(ring, q0=[0.0] * n, p0=[1.0, -1.0] * (n // 2), t_end=10.0)
solution = integrators.integrate(problem, integrators.HBVM(k=4, s=2, h=0.1))
```

`problems.VectorField(f, dim=...)` takes any first-order system, `problems.Poisson(H, B, dim=...)` a system
y' = B(y) grad H(y).

## A problem with a name

A decorated function is a problem as those above are: its arguments are checked by their annotations, it
prints as the call that makes it, and reports and the gallery have their words and their picture from the
decorator.

```python
from problems import Hamiltonian, Problem
from problems.checks import Positive
from problems.entry import entry
from problems.picture import Phase


def _energy(q, p, par):
    return p[0] ** 2 / 2 + par.k * q[0] ** 4 / 4


@entry(
    title="a quartic oscillator",
    references=("your paper",),
    notes="What to know about it.",
    shows=("k",),  # printed even at its default: quartic(k=1.0)
    picture=Phase(span=12.0),
)
def quartic(*, k: Positive = 1.0, q: float = 1.0, t_end: float = 100.0) -> Problem:
    system = Hamiltonian(_energy, dof=1, parameters={"k": k}, name="quartic")
    return Problem(system, q0=[q], p0=[0.0], t_end=t_end)
```

In a file `mine.py` it can be used at once, with the decorator or without, as `mine.py:quartic(k=2.0)` on the
command line and in a campaign file beside it (see [campaigns](campaigns.md)).
A package names it under the entry point group `hbvm_bench.problems`, as `examples/integrator` does
(`quartic = "package.module:quartic"`); in this repository it is the file `problems/catalogue/quartic.py` and
nothing else, with `expected=` for the tests.

"""

REFERENCES = """## References

Position errors are measured against solutions that two independent computations agree on: heyoka's Taylor
method in 128-bit arithmetic and Gauss collocation in double-double arithmetic (for large systems the
collocation and the Taylor method in long double). Each is a text file in `hbvm_bench/reference/data/`, with
its provenance; a chaotic problem has a reference as far as the two agree. `hbvm-bench reference "PROBLEM"`
recomputes and compares; `reference = true` in a campaign makes one for any other problem.

| problem | up to t = | the two differ by (relative) |
|---|---|---|
"""

ENGINES = """<!-- made by: hbvm-bench gallery docs -->
# Engines

Which library takes the vector field, how REBOUND takes the problem, and which method takes it: ✓, or the
number of the reason why not. The table is made by code (`hbvm-bench engines --markdown`) at each problem's
default arguments, with methods at some step or tolerance.

- numpy, numba, jax, heyoka: the field is emitted to them from one traced graph, the same operations in the
  same order. numpy and numba agree bit for bit where there are only + - * / square roots and integer powers,
  and within 2 units in the last place of the terms where there are other functions; jax and heyoka, whose
  compilers contract products and sums, within 8.
- REBOUND's bodies: gravity is REBOUND's own, from masses, positions and velocities.
- REBOUND's forces: q'' = -grad U(q) through `additional_forces`, a compiled callback; three coordinates a
  particle, as many particles as it takes.

"""


def text(names: Sequence[str]) -> str:
    """Return the page on the given problems as Markdown."""
    loaded = {name: problems.load(name) for name in names}
    parts = [HEAD, _overview(loaded), *(_section(name, problem) for name, problem in loaded.items())]
    return "".join([*parts, OWN, REFERENCES, _references()])


def write(directory: Path, *, with_pictures: bool = True) -> list[Path]:
    """Write ``problems.md``, ``engines.md`` and a picture of each problem into a directory.

    Parameters
    ----------
    directory : Path
        Such as ``docs``; pictures go into ``problems`` below it.
    with_pictures : bool
        Whether to draw them again.

    Returns
    -------
    list of Path
        What was written.
    """
    drawn = {
        name: entry.picture
        for name in registry.built_in()
        if (entry := registry.entry(name)) and entry.picture
    }
    names = [name for name, picture in drawn.items() if not picture.arguments]
    made = {
        directory / "problems.md": text(names).encode(),
        directory / "engines.md": _engines(names).encode(),
    }
    for name in drawn if with_pictures else ():
        made[directory / "problems" / f"{name}.svg"] = pictures.draw(name).encode()
    write_all(made)
    return list(made)


def _engines(names: Sequence[str]) -> str:
    table, reasons = engines.table(names)
    listed = "\n".join(f"{i}. {reason}" for i, reason in enumerate(reasons, start=1))
    return f"{ENGINES}{printed(table)}\n\n{listed}\n"


def _overview(loaded: dict[str, Problem]) -> str:
    lines = [
        "| problem | unknowns | separable | polynomial | invariants | what it tests |",
        "|---|---|---|---|---|---|",
    ]
    for name, problem in loaded.items():
        system = problem.system
        degree = structure.degree(system, problem.par)
        lines.append(
            f"| [{name}](#{name}) | {system.dim} | {'yes' if system.separable else 'no'} | "
            f"{'no' if degree is None else f'degree {degree}'} | "
            f"{', '.join(system.invariant_names).replace('_', ' ')} | {problem.notes} |"
        )
    return "\n".join(lines) + "\n\n"


def _section(name: str, problem: Problem) -> str:
    make = registry.factory(name)
    system = problem.system
    sections = _numpydoc(inspect.getdoc(make) or "")
    lines = [f"## {name}", "", f"![{problem.title}](problems/{name}.svg)", ""]
    summary = _flowed(sections.get("Summary", "")).removeprefix("Return ")
    lines += [summary[:1].upper() + summary[1:], ""]
    lines += ["$$H = " + latex(system) + "$$", ""]
    lines += [f"`{problem!r}`, t from {problem.t0:g} to {problem.t_end:g}.", ""]
    arguments = _entries(sections.get("Parameters", ""))
    lines += [f"- `{head}`: {body}" for head, body in arguments]
    returns = _entries(sections.get("Returns", ""))
    if returns:
        lines.append(f"- returns: {returns[0][1]}")
    if system.guard_names:
        lines.append(f"- stays exactly 0 by symmetry: {', '.join(system.guard_names).replace('_', ' ')}")
    lines += [f"- source: {source}" for source in problem.references]
    return "\n".join(lines) + "\n\n"


def _numpydoc(doc: str) -> dict[str, str]:
    """Split a docstring into its sections."""
    found = {"Summary": ""}
    heading = "Summary"
    lines = doc.splitlines()
    for i, line in enumerate(lines):
        below = lines[i + 1] if i + 1 < len(lines) else ""
        if line and below and set(below) == {"-"}:
            heading = line
            found[heading] = ""
        elif not (line and set(line) == {"-"}):
            found[heading] += line + "\n"
    return found


def _entries(section: str) -> list[tuple[str, str]]:
    """Return the (name and type, description) pairs of a section."""
    found: list[tuple[str, str]] = []
    for line in section.splitlines():
        if line and not line.startswith(" "):
            found.append((line, ""))
        elif line.strip() and found:
            head, body = found[-1]
            found[-1] = (head, f"{body} {line.strip()}".strip())
    return [(head, _code(body)) for head, body in found]


def _flowed(block: str) -> str:
    """Return paragraphs on one line each; indented formulas stay as they are."""
    paragraphs = re.split(r"\n\s*\n", block.strip("\n"))
    shown = [
        "```\n" + "\n".join(line[4:] for line in part.splitlines()) + "\n```"
        if part.startswith("    ")
        else _code(" ".join(part.split()))
        for part in paragraphs
    ]
    return "\n\n".join(shown)


def _code(body: str) -> str:
    return body.replace("``", "`")


def _references() -> str:
    lines = []
    for path in sorted(reference.folder().glob("*.json")):
        stored = reference.read(path)
        end = float.fromhex(stored.t[-1])
        said: Any = stored.provenance.get("agreement", "")
        lines.append(f"| `{stored.problem}` | {end:g} | {said.split(' ')[0]} |")
    return "\n".join(lines) + "\n"
