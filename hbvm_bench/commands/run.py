"""``hbvm-bench run``, and the campaigns that are commands too: ``race | endure | automatic | paper``."""

import os
import shlex
import sys
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from msgspec.structs import replace

from hbvm_bench.campaign import own
from hbvm_bench.campaign.file import Campaign, Goal, Grid, MethodEntry, ProblemEntry, file_of, load
from hbvm_bench.campaign.identity import Resolved, make_method
from hbvm_bench.campaign.shorter import chosen, quick_run, with_rounds
from hbvm_bench.campaign.spec import file_of as python_file_of
from hbvm_bench.commands.listing import as_json as run_as_json
from hbvm_bench.commands.live import Live
from hbvm_bench.measure import machine, reading
from hbvm_bench.report import terminal
from hbvm_bench.run import checked, child, computing, executors, loop, references, timing_pass
from hbvm_bench.run.executors import Pool
from hbvm_bench.run.task import InterruptedRunError, Request, UnfinishedRunError, request_of
from hbvm_bench.store.files import ensure_writable
from hbvm_bench.store.store import Index, Store
from hbvm_bench.summaries import standings
from problems.errors import InputError

COMMANDS = ("automatic", "endure", "paper", "race")
"""Campaigns by which this command is called too: it then writes the report beside the results."""
UNFINISHED = 1
INTERRUPTED = 130
ANYHOW = ("as_json", "executor", "jobs", "report_to", "timing")  # options that change no number
PRINTED = 1000  # cases; the tables of more are for `hbvm-bench show`


def run(
    context: typer.Context,
    name: Annotated[
        str | None, typer.Argument(help="A campaign, a TOML file, or a folder with study.toml.")
    ] = None,
    problem: Annotated[
        list[str] | None,
        typer.Option(
            "-p",
            "--problem",
            help='A problem, as in "sitnikov(e=0.6)" or "mine.py:swing(g=1.1)"; of a campaign, its name.',
        ),
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option("-m", "--method", help='A method, as in "HBVM(k=16, s=8, h=0.25)".')
    ] = None,
    step: Annotated[float | None, typer.Option(help="Output interval, with -p and -m.")] = None,
    reference: Annotated[
        bool,
        typer.Option(
            "--reference", help="With -p: compute a reference solution by two methods, for position errors."
        ),
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Directory of the results; default runs/NAME.")
    ] = None,
    report_to: Annotated[Path | None, typer.Option("--report", help="Also write the report there.")] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Number of cases that run in parallel; default one per core.")
    ] = None,
    executor: Annotated[
        str,
        typer.Option(
            help="Where cases run: local, dask://HOST:PORT, or MODULE:NAME of a concurrent.futures executor."
        ),
    ] = executors.LOCAL,
    timing: Annotated[
        bool, typer.Option("--timing/--no-timing", help="Run the serial timing pass, on this machine.")
    ] = True,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick", help="A tenth of the integration intervals and trajectories, few settings and rounds."
        ),
    ] = False,
    rounds: Annotated[int | None, typer.Option(min=2, help="Number of interleaved timing rounds.")] = None,
    avx2: Annotated[bool, typer.Option("--avx2", help=machine.AVX2)] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print all results as JSON.")] = False,
) -> None:
    """Run a campaign, or the given problems and methods; a second run computes only what is missing.

    Exit code 0 when every case has a row, 1 when an executor lost one or its process died three times,
    130 for Ctrl-C.
    """
    beside = str(context.info_name) in COMMANDS
    if beside:
        if name is not None:
            raise InputError(f"hbvm-bench {context.info_name} is a campaign; leave out {name!r}.")
        name = str(context.info_name)
    campaign = _campaign(name, problem, method, step, reference)
    campaign = with_rounds(quick_run(campaign) if quick else campaign, rounds)
    campaign, known = opened(campaign, name)
    study = None if name is None else file_of(name).parent
    out = out or Path("runs") / (campaign.name + "-quick" * quick + "-avx2" * avx2)
    report_to = report_to or (out / "report" if beside else None)
    if report_to is not None or (study is not None and (study / "page.md").is_file()):
        from hbvm_bench.report.page import check  # what draws costs seconds to import

        check(study)
    if report_to is not None:
        ensure_writable(out if beside else report_to, keep=False)
    os.environ |= machine.restricted_to_avx2() if avx2 else {}  # of the processes that measure
    store = carry_out(
        campaign,
        out,
        as_typed(context),
        study=study,
        executor=executor,
        jobs=jobs,
        timing=timing,
        whole=name is None or not problem,
        known=known,
    )
    if as_json:
        terminal.print_json(run_as_json(store.index(), reading.records(store)))
    else:
        show(campaign, store)
    if report_to is not None:
        from hbvm_bench.commands.publishing import report_on

        report_on([store], report_to, study, stderr=as_json)
    refuse_died(store)


def refuse_died(store: Store) -> None:
    """End with the exit code for an unfinished run where the processes of some of its cases died."""
    dead = [record.case for record in store.records() if loop.died(record)]
    if not dead:
        return
    count = "the process of 1 case" if len(dead) == 1 else f"the processes of {len(dead)} cases"
    first = f"{dead[0].method} on {dead[0].problem}"
    _say(f"{count} died {loop.ATTEMPTS} times ({first}{', ...' * (len(dead) > 1)}); run again to try again.")
    raise typer.Exit(UNFINISHED)


def opened(campaign: Campaign, name: str | None) -> tuple[Campaign, own.Known]:
    """Run the Python files beside a campaign's, or those that a command line names; see `own.opened`."""

    def tell(file: str) -> None:
        _say(f"running the Python file {file}" + (f", which {name} names" if name else ""))

    return own.opened(campaign, None if name is None else file_of(name).parent, tell)


def show(campaign: Campaign, store: Store) -> None:
    """Print the results of a run and the verdicts on its goals."""
    records = reading.records(store)
    if len(records) <= PRINTED:
        terminal.print_results(records)
    terminal.print_goals(campaign, records)


def as_typed(context: typer.Context) -> str:
    """Return how to run a command again, without the options that change no number.

    An absolute path is nobody else's: one of an option is left out too, and of a campaign's or a
    problem's file only what lies below the present directory is kept, or its name.
    """
    words = ["hbvm-bench", str(context.info_name)]
    for option in context.command.params:
        given = context.params.get(str(option.name))
        if option.name in ANYHOW or given in (None, (), option.default):
            continue
        if isinstance(given, bool):
            words.append((option.opts if given else option.secondary_opts)[-1])
        elif not (isinstance(given, Path) and given.is_absolute()):
            name = [] if option.param_type_name == "argument" else [option.opts[-1]]
            for value in given if isinstance(given, list | tuple) else [given]:
                words += [
                    *name,
                    str(value).removesuffix(".0") if isinstance(value, float) else _near(str(value)),
                ]
    return shlex.join(words)


def _near(text: str) -> str:
    """Return a word of a command line with the file that it names as seen from the present directory."""
    named = python_file_of(text) or text
    path = Path(named)
    if not path.is_absolute():
        return text
    here = Path.cwd()
    near = path.relative_to(here).as_posix() if path.is_relative_to(here) else path.name
    return near + text.removeprefix(named)


def carry_out(
    campaign: Campaign,
    directory: Path,
    command: str,
    *,
    study: Path | None = None,
    executor: str = executors.LOCAL,
    jobs: int | None = None,
    timing: bool = True,
    whole: bool = False,
    known: own.Known = own.NOTHING,
) -> Store:
    """Run what is missing of a campaign in a directory, and return its store; ``command`` runs it again.

    ``study`` is the folder of the campaign's file, in which its computations are; ``known`` is what is known
    of its problems beside their texts.

    All that a campaign says is checked where it is ``whole``: what is left out of one, such as a method, may
    still be named in a goal.

    Raises
    ------
    problems.errors.InputError
        If a name or an option in the campaign is wrong, before anything is written.
    typer.Exit
        With 130 after Ctrl-C, and 1 if an executor lost some cases; what finished is kept.
    """
    store = Store(directory)
    known = store.known() | known
    cases = loop.plan(campaign, known)
    if whole:
        checked.check(campaign, cases)
    computations = computing.plan(campaign, study)
    with executors.opened(executor, jobs) as pool:  # what is refused is refused before anything is written
        store.prepare()
        if (more := references.make_missing(campaign, store, known, _say)) is not known:
            known, cases = more, loop.plan(campaign, more)  # the grid and the ids belong to references
        with store.locked():
            ids = [case.id for case in cases]
            asked = dated(campaign, store)
            index = Index(campaign=asked, ids=ids, version=version("hbvm-bench"), command=command)
            store.write_index(index, known)
            try:
                _run(campaign, cases, computations, store, pool, timing)
            except (KeyboardInterrupt, InterruptedRunError):
                raise _given_up("interrupted", ids, store, INTERRUPTED) from None
            except UnfinishedRunError as error:
                raise _given_up(str(error), ids, store, UNFINISHED) from None
    return store


def dated(campaign: Campaign, store: Store) -> Campaign:
    """Return a campaign whose goals say when this run first had them, and what it had measured before.

    A goal that the run had before keeps its dates, whatever its words are now; another goal is new.
    """
    had = {_undated(declared): declared for declared in store.goals()}
    new = {_undated(declared): declared for declared in campaign.goals if _undated(declared) not in had}
    now = datetime.now(UTC).isoformat(timespec="seconds")
    ended = [declared.finished for declared in store.everything() if declared.finished] if new else []
    first = min(ended, default="")
    for key, declared in new.items():
        had[key] = replace(declared, declared=declared.declared or now, measured=declared.measured or first)
    return replace(campaign, goals=[had[_undated(goal)] for goal in campaign.goals])


def _undated(goal: Goal) -> bytes:
    return msgspec.json.encode(replace(goal, words="", declared="", measured=""))


def _say(sentence: str) -> None:
    print(f"hbvm-bench: {sentence}", file=sys.stderr)


def _given_up(why: str, ids: list[str], store: Store, code: int) -> typer.Exit:
    child.stopping.set()
    kept = sum(store.load(key) is not None for key in ids)
    done = f"{why}: {kept} of {len(ids)} cases are kept in {store.directory}"
    _say(f"{done}; run the same command again to go on.")
    return typer.Exit(code)


def _campaign(
    name: str | None,
    problems: list[str] | None,
    methods: list[str] | None,
    step: float | None,
    reference: bool,
) -> Campaign:
    if name is not None:
        if methods or step is not None or reference:
            raise InputError("give either a campaign or -m, --step and --reference, not both.")
        return chosen(load(name), problems or [])
    if not problems or not methods:
        raise InputError('give a campaign, or at least one -p "PROBLEM(...)" and one -m "METHOD(...)".')
    if step is not None and not 0 < step < float("inf"):
        raise InputError(f"--step must be a positive number, not {step!r}.")
    for text in methods:
        make_method(text)
    return Campaign(
        name="custom",
        title="Problems and methods given on the command line",
        problems=[ProblemEntry(use=text, reference=reference) for text in problems],
        methods=[MethodEntry(use=text) for text in methods],
        grid=Grid(step=step),
    )


def _run(
    campaign: Campaign,
    cases: list[Resolved],
    computations: list[Request],
    store: Store,
    pool: Pool,
    timing: bool,
) -> None:
    child.stopping.clear()
    missing = [case for case in cases if not loop.is_done(store.load(case.id), campaign.limits)]
    with Live() as live:
        try:
            live.phase(f"measuring {pool.where}", len(missing), len(cases) - len(missing))
            requests = [request_of(case, campaign.limits) for case in missing]
            for record in loop.run_accuracy(requests, store, pool, live.running):
                live.case(record)
            if left := computing.missing(computations, store):
                live.phase("computing", len(left), len(computations) - len(left))
                for record in computing.run(left, store, pool, live.running):
                    live.case(record)
            if timing:
                _time(campaign, cases, store, live)
        except BaseException:
            child.stopping.set()  # or the executor would wait for the ends of its cases
            raise
        live.say(f"done in {live.elapsed:.0f} s; results in {store.directory}")


def _time(campaign: Campaign, cases: list[Resolved], store: Store, live: Live) -> None:
    visits = timing_pass.missing_visits(cases, store, campaign.timing)
    if not visits:
        return
    if old := timing_pass.outdated(cases, store, campaign.timing):
        live.say(f"the plan of the timing has changed: {old} cases are timed again")
    live.phase("timing, problem by problem", visits, 0)
    timing_pass.time_cases(
        cases, store, campaign.timing, campaign.limits, live.visit, standings.asked(campaign)
    )
    live.visited()
