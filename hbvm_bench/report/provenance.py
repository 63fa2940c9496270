"""What was measured with: days, versions, machines, and what the machine code is built for."""

from collections.abc import Mapping, Sequence
from datetime import datetime

from hbvm_bench.measure import machine
from hbvm_bench.store.records import Load, Record
from hbvm_bench.summaries import outcomes
from hbvm_bench.summaries.table import Table
from integrators.registry import libraries

DIGITS = 12  # of a digest


def days(records: Sequence[Record]) -> str:
    """Return the days on which the cases ran: ``"2026-11-21"``, ``"2026-11-20 to 2026-11-21"``."""
    days_ = sorted({datetime.fromisoformat(r.finished).date().isoformat() for r in records if r.finished})
    return "" if not days_ else days_[0] if days_[0] == days_[-1] else f"{days_[0]} to {days_[-1]}"


def measured_on(day: str, kernel: str, loads: Sequence[Load]) -> str:
    """Say when something was measured, with which kernel, and beside what other work."""
    beside = f" {outcomes.other_work(loads)}" if loads else ""
    return f"Measured on {day} with the kernel {kernel[:DIGITS]}.{beside}"


def versions(records: Sequence[Record]) -> dict[str, str]:
    """Return the versions of the libraries, and how their machine code came about."""
    numbers_of = _each_once([record.versions for record in records], ", ")
    built = {library: method.built for library, method in libraries().items()}
    return {
        name: f"{numbers} ({built[name.lower()]})" if built.get(name.lower()) else numbers
        for name, numbers in numbers_of.items()
    }


def processors(records: Sequence[Record]) -> list[str]:
    """Say what kinds of processor the times were taken on; nothing where none were taken."""
    timings = [record.timing for record in records if record.timing is not None and record.timing.rounds]
    return machine.sentences(timing.machine for timing in timings if timing.machine)


def _each_once(all_: Sequence[Mapping[str, object]], glue: str) -> dict[str, str]:
    """Return the values by name; those that differ stand side by side."""
    values_of: dict[str, set[str]] = {}
    for mapping in all_:
        for name, value in mapping.items():
            values_of.setdefault(name, set()).add(str(value))
    return {name: glue.join(sorted(values)) for name, values in sorted(values_of.items())}


def facts(records: Sequence[Record]) -> list[Table]:
    """Return the tables of what is known of the machine and of the libraries."""
    known = _each_once([record.machine for record in records], " | ")
    machines = [(name.replace("_", " "), values) for name, values in known.items()]
    tables = ((("machine", ""), machines), (("library", "version"), [*versions(records).items()]))
    return [Table("", head, rows, words=(0, 1)) for head, rows in tables if rows]
