"""The process in which a contest runs: ``python -m hbvm_bench.studies.race.child REQUEST.json``.

A process of its own: one thread, one core, no other library loaded than the race needs;
and when a library crashes, the other contests go on.
"""

import sys
import time
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.measure import machine
from hbvm_bench.report import terminal
from hbvm_bench.run import processes
from hbvm_bench.studies.race import results, truth
from hbvm_bench.studies.race.accuracy import prepare
from hbvm_bench.studies.race.contests import CONTESTS, QUICK_SHARE
from hbvm_bench.studies.race.probe import probe
from hbvm_bench.studies.race.results import Contest, Race, Setting
from hbvm_bench.studies.race.rounds import time_rounds
from hbvm_bench.studies.race.settings import OURS, settings

LIBRARIES = ("hbvm-bench", "numpy", "numba", "llvmlite", "scipy", "heyoka", "rebound")


class Request(msgspec.Struct, frozen=True, kw_only=True):
    """What the process is asked to do.

    Attributes
    ----------
    contests : list of str
        Their keys.
    out : str
        The directory for the results.
    quick : bool
        A tenth of the span and fewer settings.
    rounds : int
        Rounds of timing.
    probes : bool
        Whether to measure compile times in fresh processes too.
    command : str
        How to run it again.
    """

    contests: list[str]
    out: str
    quick: bool
    rounds: int
    probes: bool
    command: str


def main(path: Path) -> None:
    """Run the contests of a request and store their results."""
    described = machine.describe(measure=True)
    processes.settle()
    request = msgspec.json.decode(path.read_bytes(), type=Request)
    for key in request.contests:
        results.save(run(CONTESTS[key], request, described), Path(request.out))


def run(contest: Contest, request: Request, described: dict[str, str | int]) -> Race:
    """Run one contest and return its result.

    Parameters
    ----------
    contest : Contest
        What to run.
    request : Request
        How.
    described : dict
        The machine in words.
    """
    started, start = datetime.now(UTC).isoformat(timespec="seconds"), time.perf_counter()
    problem = make_problem(contest.problem)
    true = truth.known(problem)
    share = QUICK_SHARE if request.quick else 1.0
    t_end = float(true.t[truth.nearest(true, problem.t0 + share * (problem.t_end - problem.t0))])
    declared = settings(contest.key, quick=request.quick)
    with _progress() as bar:
        bar.console.print(f"{contest.key}: {len(declared)} settings", highlight=False)
        task = bar.add_task(f"{contest.key}: errors", total=len(declared), now="")
        entries = []
        for setting in declared:
            bar.update(task, now=setting.method)
            entries.append(prepare(problem, setting, true, t_end))
            bar.advance(task)
        bar.reset(task, total=request.rounds, description=f"{contest.key}: times")

        def tell(number: int) -> None:
            bar.update(task, completed=number, now=f"round {number + 1}")

        bar.console.print(f"{contest.key}: {request.rounds} rounds of timing", highlight=False)
        outcomes, calibration, load = time_rounds(entries, request.rounds, tell)
        bar.update(task, completed=request.rounds, now="compile times" if request.probes else "")
        families = list(dict.fromkeys(setting.family for setting in declared))
        probes = probe(contest, _step(declared), families) if request.probes else []
    return Race(
        contest=contest,
        t_end=t_end,
        quick=request.quick,
        outcomes=outcomes,
        rounds=request.rounds,
        calibration=calibration,
        probes=probes,
        reference=true.provenance,
        load=load,
        machine=described,
        versions={name: _version(name) for name in LIBRARIES},
        command=request.command,
        started=started,
        seconds=round(time.perf_counter() - start, 1),
    )


def _step(declared: list[Setting]) -> float:
    """Return the step of the first of our settings, for the probes."""
    ours = next(setting for setting in declared if setting.family == OURS)
    return float(parse_spec(ours.method).arguments["h"])


def _progress() -> Progress:
    console = terminal.console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("[dim]{task.fields[now]}", markup=True),
        console=console,
        disable=not console.is_terminal,
    )


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


if __name__ == "__main__":
    main(Path(sys.argv[1]))
