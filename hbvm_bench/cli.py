"""The command line: ``hbvm-bench list | run | report | show | cite | reference``."""

import shlex
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from typer.exceptions import TyperException

from hbvm_bench import listing, runner, supervise, terminal
from hbvm_bench.campaign import Campaign, Grid, MethodEntry, load
from hbvm_bench.identity import Resolved, make_method, make_problem
from hbvm_bench.metrics import find
from hbvm_bench.records import Record
from hbvm_bench.store import Index, Store, ensure_writable
from problems.errors import InputError

app = typer.Typer(
    name="hbvm-bench",
    help="Which integrator keeps what, at what cost.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

OutOption = Annotated[Path | None, typer.Option("--out", help="Where results go; default runs/NAME.")]
ReportOption = Annotated[Path | None, typer.Option("--report", help="Also write the report there.")]
ProblemOption = Annotated[
    list[str] | None, typer.Option("-p", "--problem", help='A problem, as in "sitnikov(e=0.6)".')
]
MethodOption = Annotated[
    list[str] | None, typer.Option("-m", "--method", help='A method, as in "HBVM(k=16, s=8, h=0.25)".')
]


# Commands with an implementation of their own; each is imported only when it is asked for.
SEPARATE = {
    "race": "hbvm_bench.race.command",
    "endure": "hbvm_bench.endure.command",
    "paper": "hbvm_bench.paper.command",
    "engines": "hbvm_bench.commands.engines",
    "gallery": "hbvm_bench.commands.gallery",
    "inspect": "hbvm_bench.commands.inspect",
}


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code: 0, 2 for input errors, 130 for Ctrl-C."""
    _attach(sys.argv[1:] if arguments is None else arguments)
    try:
        code = app(arguments, prog_name="hbvm-bench", standalone_mode=False)
    except InputError as error:
        return _fail(str(error))
    except TyperException as error:
        return _fail(error.format_message())
    except typer.Abort:
        return 130
    except SystemExit:  # typer's answer to a reader that has gone, as in `hbvm-bench list | head`
        return 0
    return code if isinstance(code, int) else 0


def _attach(arguments: list[str]) -> None:
    present = {
        command.name or getattr(command.callback, "__name__", "") for command in app.registered_commands
    }
    asked = next((word for word in arguments if not word.startswith("-")), None)
    if asked in present:
        return
    # all of them for --help, and for the suggestions where there is no such command
    for name in [asked] if asked in SEPARATE else sorted(SEPARATE.keys() - present):
        app.command(name)(getattr(import_module(SEPARATE[name]), name))


def _fail(sentence: str) -> int:
    one_line = " ".join(sentence.split())
    print(f"hbvm-bench: {one_line}" if one_line else "hbvm-bench: nothing to do; see --help", file=sys.stderr)
    return 2


def _version(wanted: bool) -> None:
    if wanted:
        print(f"hbvm-bench {version('hbvm-bench')}")
        raise typer.Exit


@app.callback()
def _options(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    del show_version


@app.command("list")
def list_(
    what: Annotated[
        str, typer.Argument(help="problems, methods, metrics or campaigns; all by default.")
    ] = "",
) -> None:
    """List what there is: problems, methods with their options, metrics, campaigns."""
    terminal_ = terminal.console()
    for table in listing.tables(what):
        terminal_.print(table)


@app.command()
def run(
    name: Annotated[str | None, typer.Argument(help="A campaign's name, or a TOML file.")] = None,
    problem: ProblemOption = None,
    method: MethodOption = None,
    step: Annotated[float | None, typer.Option(help="Distance of the samples, with -p and -m.")] = None,
    out: OutOption = None,
    report_to: ReportOption = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Cases side by side; default one per core.")] = None,
    timing: Annotated[bool, typer.Option("--timing/--no-timing", help="The serial timing pass.")] = True,
) -> None:
    """Run a campaign, or the given problems and methods; a rerun does only what is missing."""
    campaign = _campaign(name, problem, method, step)
    cases = runner.plan(campaign)
    store = Store(out or Path("runs") / campaign.name)
    store.prepare()
    if report_to is not None:
        ensure_writable(report_to)
    store.write_index(
        Index(
            campaign=campaign,
            ids=[case.id for case in cases],
            version=version("hbvm-bench"),
            command=_command(name, problem, method, step),
        )
    )
    try:
        _run(campaign, cases, store, jobs, timing)
    except (KeyboardInterrupt, runner.InterruptedRunError):
        supervise.stop_all()
        kept = sum(store.load(case.id) is not None for case in cases)
        message = f"interrupted: {kept} of {len(cases)} cases are kept in {store.directory}; "
        print(f"hbvm-bench: {message}run the same command again to go on.", file=sys.stderr)
        raise typer.Exit(130) from None
    _print_results(store.records(), None, None)
    if report_to is not None:
        _write_report(store, report_to)


@app.command()
def report(
    directory: Annotated[Path, typer.Argument(help="A run, as in runs/sitnikov.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Default: DIRECTORY/report.")] = None,
) -> None:
    """Write the report of a run: report.md, index.html and figures; nothing is run again."""
    store = Store(directory)
    store.index()
    target = out or directory / "report"
    ensure_writable(target)
    _write_report(store, target)


@app.command()
def show(
    directory: Annotated[Path, typer.Argument(help="A run, as in runs/sitnikov.")],
    as_json: Annotated[bool, typer.Option("--json", help="Everything, for programs.")] = False,
    metric: Annotated[
        list[str] | None, typer.Option("--metric", help="Only these; see list metrics.")
    ] = None,
    sort: Annotated[str | None, typer.Option(help="Metric to sort by within the groups.")] = None,
) -> None:
    """Print the results of a run."""
    for key in [*(metric or []), *([sort] if sort else [])]:
        find(key)
    store = Store(directory)
    index = store.index()
    records = store.records()
    if as_json:
        encoded = msgspec.json.encode(listing.as_json(index, records))
        print(msgspec.json.format(encoded, indent=1).decode())
        return
    if not records:
        raise InputError(f"the run in {str(directory)!r} has no finished case yet; run: {index.command}.")
    _print_results(records, metric, sort)
    missing = len(index.ids) - len(records)
    if missing:
        terminal.console(stderr=True).print(f"{missing} of {len(index.ids)} cases have not run yet.")


@app.command()
def cite(
    methods: Annotated[
        list[str] | None, typer.Argument(help="Names or calls; all methods by default.")
    ] = None,
) -> None:
    """Print how the authors of methods and libraries ask to be cited."""
    for text in listing.citations(methods or []):
        print(text, end="\n\n")


@app.command()
def reference(
    problem: Annotated[str, typer.Argument(help='A problem, as in "sitnikov()".')],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Write the computed reference there.")
    ] = None,
    until: Annotated[float | None, typer.Option(help="How far, where no reference is stored yet.")] = None,
) -> None:
    """Recompute the reference solution of a problem in two ways and compare it with the stored one."""
    import numpy as np

    from hbvm_bench import reference as references
    from hbvm_bench import trusted

    made = make_problem(problem)
    if out is not None:
        ensure_writable(out.parent)
    stored = references.find_file(made)
    at = None if stored is None else np.array([float.fromhex(time) for time in stored.t])
    fresh = trusted.make(made, until, at)
    for key, value in fresh.provenance.items():
        print(f"{key}: {value}")
    print(f"end state: {' '.join(fresh.y[-1])}")
    if stored is None:
        print("there is no stored reference of this problem.")
    else:
        print(f"largest difference from the stored reference: {references.difference(stored, fresh):.1e}")
    if out is not None:
        out.write_text(references.encode(fresh), encoding="ascii")


def _campaign(
    name: str | None, problems: list[str] | None, methods: list[str] | None, step: float | None
) -> Campaign:
    if name is not None:
        if problems or methods or step is not None:
            raise InputError("give either a campaign or -p, -m and --step, not both.")
        return load(name)
    if not problems or not methods:
        raise InputError('give a campaign, or at least one -p "PROBLEM(...)" and one -m "METHOD(...)".')
    if step is not None and not 0 < step < float("inf"):
        raise InputError(f"--step must be a positive number, not {step!r}.")
    for text in methods:
        make_method(text)
    return Campaign(
        name="custom",
        title="Problems and methods given on the command line",
        problems=list(problems),
        methods=[MethodEntry(use=text) for text in methods],
        grid=Grid(step=step),
    )


def _command(
    name: str | None, problems: list[str] | None, methods: list[str] | None, step: float | None
) -> str:
    words = ["hbvm-bench", "run", *([name] if name else [])]
    words += [word for text in problems or [] for word in ("-p", text)]
    words += [word for text in methods or [] for word in ("-m", text)]
    words += ["--step", repr(step)] if step is not None else []
    return shlex.join(words)


def _run(campaign: Campaign, cases: list[Resolved], store: Store, jobs: int | None, timing: bool) -> None:
    supervise.allow()
    missing = [case for case in cases if not runner.is_done(store.load(case.id), campaign.limits)]
    with (
        terminal.Live(len(cases)) as live,
        runner.local_executor(jobs or len(runner.machine.cores())) as pool,
    ):
        try:
            live.phase("measuring", len(cases), len(cases) - len(missing))
            for record in runner.run_accuracy(missing, store, campaign.limits, pool):
                live.case(record)
            if timing:
                visits = runner.missing_visits(cases, store, campaign.timing)
                live.phase("timing, one at a time", visits)
                runner.time_cases(cases, store, campaign.timing, campaign.limits, live.visit)
        except BaseException:
            supervise.stop_all()
            raise
        live.say(f"done in {live.elapsed:.0f} s; results in {store.directory}")


def _print_results(records: list[Record], keys: list[str] | None, sort: str | None) -> None:
    console = terminal.console()
    for table in terminal.results(records, keys, sort, console.width):
        console.print(table)


def _write_report(store: Store, directory: Path) -> None:
    from hbvm_bench.report.write import write_report

    for path in write_report(store, directory):
        print(path)


if __name__ == "__main__":
    sys.exit(main())
