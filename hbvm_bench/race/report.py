"""The report of a race: ``README.md``, ``index.html`` and ``figures/``, from stored results alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from hbvm_bench.cells import Table, in_markdown
from hbvm_bench.race import tables
from hbvm_bench.race.accuracy import SAMPLES
from hbvm_bench.race.figures import work_precision
from hbvm_bench.race.results import Race
from hbvm_bench.race.rounds import SHORTEST
from hbvm_bench.race.settings import FAMILIES
from hbvm_bench.race.standings import calibrated, present
from hbvm_bench.report.canvas import Picture, inline_svg
from hbvm_bench.report.markdown import code, plain
from hbvm_bench.report.style import DARK_NEUTRALS, NEUTRALS, base_colours
from hbvm_bench.store import atomic, ensure_writable

FIGURES = "figures"
BUSY = 0.05  # of a core: more than this beside the race makes its times doubtful

RULES_TEXT = f"""
Every family has the same number of settings on every problem, declared in hbvm_bench/race/settings.py
before the run. The fastest setting that is accurate enough is picked afterwards, by the same rule for
every family.

Energy is never ranked without position: a setting counts only if both errors are small enough. A run
that leaves the trajectory which a symmetry prescribes is void.

The same initial doubles and the same vector field for all, from one definition; REBOUND, which computes
gravity itself, receives the same bodies.

One process, one thread, one core. All settings of a problem are timed in interleaved rounds, each round
in an order shuffled anew, with garbage collection off; all samples are kept. Timed is the call that
integrates from the start to the end time and returns the end state, without output; compiling and
setting up are not in it. A sample is as many such runs one after the other as last
{SHORTEST * 1e3:.0f} ms. The overhead of one call is in the tables.

The energy error is the largest at some {SAMPLES} times, one in each equal part of the span and at no
common phase, at the methods' own steps where the step is fixed, else by the means that cost the method
nothing; it is evaluated in double-double arithmetic. The position error is that of the end state of the
very run that is timed, relative, in the 2-norm over all bodies, against a 128-bit solution.

A setting too slow for all rounds takes part in fewer, and the table says so. What did not finish, or
does not apply, is a row with its reason.
"""
RULES = tuple(" ".join(paragraph.split()) for paragraph in RULES_TEXT.strip().split("\n\n"))


@dataclass(frozen=True)
class Section:
    """What the report says about one contest."""

    race: Race
    picture: Picture | None
    tables: list[Table]
    full: Table
    remarks: list[str]


def write(races: Sequence[Race], directory: Path) -> list[Path]:
    """Write the report and return the paths of its two documents.

    Raises
    ------
    problems.errors.InputError
        If the directory cannot be written.
    """
    sections = [section(race) for race in races]
    top = [tables.headline(races), tables.goals(races)]
    documents = {"README.md": markdown(sections, top), "index.html": page(sections, top)}
    made: dict[Path, bytes] = {directory / name: text.encode() for name, text in documents.items()}
    for one in sections:
        if one.picture is not None:
            made[directory / FIGURES / f"{one.picture.key}.svg"] = one.picture.svg.encode()
    ensure_writable(directory / FIGURES)
    for path, data in made.items():
        with atomic(path) as temporary:
            temporary.write_bytes(data)
    return [directory / name for name in documents]


def section(race: Race) -> Section:
    """Gather what the report says about one contest."""
    shown = [tables.fastest(race), tables.levels(race), tables.defaults(race), tables.compiling(race)]
    return Section(
        race,
        work_precision(race),
        [t for t in shown if t is not None],
        tables.everything(race),
        remarks(race),
    )


def remarks(race: Race) -> list[str]:
    """Return what a reader must know about how a contest was run."""
    said = [race.contest.note] if race.contest.note else []
    per_family = {
        f: sum(o.setting.family == f for o in race.outcomes if o.status != "refused") for f in present(race)
    }
    absent = [FAMILIES[f].title for f, n in per_family.items() if not n]
    if absent:
        said.append(f"Does not apply: {', '.join(absent)}.")
    if race.quick:
        said.append("This is the quick run: a tenth of the span and few settings; its ratios mean little.")
    calibration = calibrated(race)
    if calibration:
        worst = max(abs(value / calibration - 1.0) for value in race.calibration)
        said.append(
            f"A fixed computation beside it took {calibration * 1e3:.2f} ms, and in its worst round "
            f"{worst:.0%} more or less."
        )
    if race.load is not None:
        doubt = "; its times are doubtful" if max(race.load.others, race.load.stolen) > BUSY else ""
        said.append(
            f"Meanwhile other processes used {race.load.others:.0%} of a core, and the host kept "
            f"{race.load.stolen:.0%} of one{doubt}."
        )
    return said


def markdown(sections: Sequence[Section], top: Sequence[Table]) -> str:
    """Return the report as markdown, with relative links to its figures."""
    environment = _environment(autoescape=False)
    environment.filters |= {"plain": plain, "code": code, "table": in_markdown}
    return environment.get_template("race.md.j2").render(**_content(sections, top))


def page(sections: Sequence[Section], top: Sequence[Table]) -> str:
    """Return the report as one self-contained HTML document."""
    environment = _environment(autoescape=True)
    themed = {f"--{name.lower()}": base_colours(name) for name in _names()}
    colours = {light: variable for variable, (light, _) in themed.items()}
    environment.globals |= {"drawn": lambda picture: Markup(inline_svg(picture, colours))}
    light = {v: k for k, v in NEUTRALS.items()} | {variable: pair[0] for variable, pair in themed.items()}
    dark = DARK_NEUTRALS | {variable: pair[1] for variable, pair in themed.items()}
    return environment.get_template("race.html.j2").render(
        css=Markup((files("hbvm_bench.report") / "templates" / "style.css").read_text(encoding="utf-8")),
        light=_variables(light),
        dark=_variables(dark),
        **_content(sections, top),
    )


def _content(sections: Sequence[Section], top: Sequence[Table]) -> dict[str, object]:
    last = max((s.race for s in sections), key=lambda race: race.started)
    return {
        "sections": sections,
        "top": top,
        "rules": RULES,
        "families": [(family.title, family.code) for family in FAMILIES.values()],
        "machine": list(last.machine.items()),
        "versions": list(last.versions.items()),
        "command": last.command,
        "started": sorted({s.race.started[:10] for s in sections}),
        "figures": FIGURES,
    }


def _names() -> list[str]:
    return ["Gauss", *(family.lead for family in FAMILIES.values())]


def _environment(*, autoescape: bool) -> Environment:
    return Environment(
        loader=PackageLoader("hbvm_bench.race", "templates"),
        autoescape=autoescape,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )


def _variables(values: dict[str, str]) -> Markup:
    return Markup("".join(f"{name}:{value};" for name, value in values.items()))
