"""The report of a race: ``README.md``, ``index.html`` and ``figures/``, from stored results alone."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hbvm_bench.measure import machine
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.report import shell
from hbvm_bench.report.figures import canvas
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.report.figures.style import Look
from hbvm_bench.report.markdown import code, in_markdown
from hbvm_bench.store.files import write_all
from hbvm_bench.studies.race import tables
from hbvm_bench.studies.race.accuracy import SAMPLES
from hbvm_bench.studies.race.contests import CONTESTS
from hbvm_bench.studies.race.figures import looks, work_precision
from hbvm_bench.studies.race.results import SCHEMA, Race, by_kind
from hbvm_bench.studies.race.rounds import SHORTEST
from hbvm_bench.studies.race.settings import FAMILIES
from hbvm_bench.studies.race.standings import calibrated, present
from hbvm_bench.summaries import peers
from hbvm_bench.summaries.table import Table

BUSY = 0.05  # of a core: more than this beside the race makes its times doubtful

RULES_TEXT = f"""
Every family has the same number of settings on every problem, declared in hbvm_bench/studies/race/settings.py
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
nothing; it is evaluated in double-double arithmetic.

The position error is that of the end state of the very run that is timed. {POSITION}

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
    look = looks(races)
    sections = [section(race, look) for race in races]
    top = [tables.headline(races), tables.goals(races)]
    found = by_kind(directory, list(CONTESTS))
    if len(found) > 1:
        top.insert(1, tables.kinds(found))
    made = {
        "data/settings.csv": settings_csv(sections).encode(),
        "README.md": markdown(sections, top).encode(),
        "index.html": page(sections, top, look).encode(),
        **canvas.files(s.picture for s in sections if s.picture is not None),
    }
    write_all({directory / name: data for name, data in made.items()})
    return [directory / "README.md", directory / "index.html"]


def section(race: Race, look: Mapping[str, Look]) -> Section:
    """Gather what the report says about one contest."""
    shown = [tables.fastest(race), tables.levels(race), tables.defaults(race), tables.compiling(race)]
    return Section(
        race,
        work_precision(race, look),
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
    said += earlier_definition(race)
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


def earlier_definition(race: Race) -> list[str]:
    """Return what to know of a race's position errors where the definition has changed since."""
    if race.schema == SCHEMA:
        return []
    return [
        "The position errors are of an earlier definition: in the 2-norm over all bodies, relative to "
        "that of the true positions at the end."
    ]


def markdown(sections: Sequence[Section], top: Sequence[Table]) -> str:
    """Return the report as markdown, with relative links to its figures."""
    environment = shell.environment("hbvm_bench.studies.race", autoescape=False)
    environment.filters |= {"code": code, "table": in_markdown}
    return environment.get_template("race.md.j2").render(**_content(sections, top))


def page(sections: Sequence[Section], top: Sequence[Table], look: Mapping[str, Look]) -> str:
    """Return the report as one self-contained HTML document."""
    environment = shell.environment("hbvm_bench.studies.race", autoescape=True)
    return environment.get_template("race.html.j2").render(
        **_content(sections, top),
        **shell.values(
            [s.picture for s in sections if s.picture is not None],
            list(look.values()),
            names={one.number: name for name, one in look.items()},
            data={"csv": settings_csv(sections)},
        ),
    )


def _content(sections: Sequence[Section], top: Sequence[Table]) -> dict[str, object]:
    races = sorted((s.race for s in sections), key=lambda race: race.started)
    last = races[-1]
    return {
        "sections": sections,
        "top": top,
        "rules": RULES,
        # older results were timed in another way than the one that was checked
        "peers": peers.kept() if all(race.schema == SCHEMA for race in races) else None,
        "families": [(family.title, family.code) for family in FAMILIES.values()],
        "processors": machine.sentences(race.machine for race in races),
        "machine": list(last.machine.items()),
        "versions": list(last.versions.items()),
        "command": commands(races),
        "started": sorted({s.race.started[:10] for s in sections}),
    }


def commands(races: Sequence[Race]) -> str:
    """Return the commands the contests came from; one if together they are all contests, run alike."""
    words = [race.command.split(" ") for race in races]
    alike = {
        " ".join(w for i, w in enumerate(ws) if "--problem" not in (w, ws[max(i - 1, 0)])) for ws in words
    }
    if len(alike) == 1 and {race.contest.key for race in races} == set(CONTESTS):
        return alike.pop()
    return "\n".join(dict.fromkeys(race.command for race in races))


def settings_csv(sections: Sequence[Section]) -> str:
    """Return all settings of all contests as one table of text."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    for number, one in enumerate(sections):
        if number == 0:
            writer.writerow(["contest", *one.full.head])
        writer.writerows([one.race.contest.key, *row] for row in one.full.rows)
    return stream.getvalue()
