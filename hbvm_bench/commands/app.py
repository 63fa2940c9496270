"""The commands: ``hbvm-bench list | run | report | show | cite | ...``."""

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer
from typer.exceptions import TyperException

from hbvm_bench.campaign.identity import typed_problem
from hbvm_bench.commands import listing
from hbvm_bench.measure import reading
from hbvm_bench.measure.metrics import find
from hbvm_bench.report import terminal
from hbvm_bench.store.files import ensure_writable, write_all
from hbvm_bench.store.store import Store
from problems.errors import InputError, printable

app = typer.Typer(
    name="hbvm-bench",
    help="Compare how integrators conserve energy, how accurate they are, and what they cost.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

# Commands with an implementation of their own; each is imported only when it is asked for.
SEPARATE = {
    command: f"hbvm_bench.commands.{module}"
    for module, commands in {
        "about": ("advise", "engines", "inspect"),
        "doctor": ("doctor", "warm"),
        "reports": ("report",),
        "run": ("run", "automatic", "endure", "paper", "race"),
        "stores": ("compare", "export", "merge"),
    }.items()
    for command in commands
}


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code, as `hbvm_bench.cli.main`."""
    attach(sys.argv[1:] if arguments is None else arguments)
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


def attach(arguments: Sequence[str] = ()) -> None:
    """Import the command that is asked for and make it one of `app`'s; all of them where none is."""
    present = {
        command.name or getattr(command.callback, "__name__", "") for command in app.registered_commands
    }
    asked = next((word for word in arguments if not word.startswith("-")), "")
    if asked in present:
        return
    # all of them for --help, and for the suggestions where there is no such command
    for name in [asked] if asked in SEPARATE else sorted(SEPARATE.keys() - present):
        module = import_module(SEPARATE[name])
        if hasattr(module, name):
            app.command(name)(getattr(module, name))
        else:
            said = f"Run the campaign {name}, as `hbvm-bench run {name}`, with its report beside the results."
            app.command(name, help=said)(module.run)


def _fail(sentence: str) -> int:
    one_line = printable(" ".join(sentence.split()))
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
    kind: Annotated[
        str, typer.Argument(help="problems, methods, metrics or campaigns; all by default.")
    ] = "",
) -> None:
    """List the problems, the methods with their options, the metrics and the campaigns."""
    for table in listing.tables(kind):
        terminal.print_table(table)


@app.command()
def show(
    directory: Annotated[Path, typer.Argument(help="A run, as in runs/sitnikov.")],
    as_json: Annotated[bool, typer.Option("--json", help="JSON output.")] = False,
    metric: Annotated[
        list[str] | None,
        typer.Option("--metric", help="Print only these metrics; see `hbvm-bench list metrics`."),
    ] = None,
    sort: Annotated[str | None, typer.Option(help="Metric to sort by within each group.")] = None,
) -> None:
    """Print the results of a run."""
    for key in [*(metric or []), *([sort] if sort else [])]:
        find(key)
    store = Store(directory)
    index = store.index()
    records = reading.records(store)
    if as_json:
        terminal.print_json(listing.as_json(index, records))
        return
    if not records:
        raise InputError(f"the run in {str(directory)!r} has no finished case yet; run: {index.command}.")
    terminal.print_results(records, metric, sort)
    terminal.print_goals(index.campaign, records)
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
        Path | None, typer.Option("-o", "--out", help="File to write the computed reference to.")
    ] = None,
    until: Annotated[float | None, typer.Option(help="End time, where no reference is stored yet.")] = None,
    agreement: Annotated[
        float | None,
        typer.Option(min=0.0, max=1.0, help="How far the two may differ, for long intervals; as 1e-10."),
    ] = None,
) -> None:
    """Recompute the reference solution of a problem in two ways and compare it with the stored one."""
    import numpy as np

    from hbvm_bench.reference import solutions, trusted

    loaded = typed_problem(problem)
    if out is not None:
        ensure_writable(out.parent)
    stored = solutions.find_file(loaded)
    at = None if stored is None else np.array([float.fromhex(time) for time in stored.t])
    fresh = trusted.make(loaded, until, at, agreement)
    for key, value in fresh.provenance.items():
        print(f"{key}: {value}")
    print(f"end state: {' '.join(fresh.y[-1])}")
    if stored is None:
        print("there is no stored reference of this problem.")
    else:
        print(f"largest difference from the stored reference: {solutions.difference(stored, fresh):.1e}")
    if out is not None:
        write_all({out: solutions.encode(fresh).encode("ascii")})
