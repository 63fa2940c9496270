"""A run for other tools: JSON, and flat tables as CSV or, with the extra ``hbvm-bench[export]``, Parquet."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import msgspec
import numpy as np

from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.measure import reading
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.store.files import atomic, csv_of
from hbvm_bench.store.records import Record, Timing, Value
from hbvm_bench.store.store import Store
from problems.errors import InputError, MissingLibraryError, unknown

ExportRow = tuple[Any, ...]
FORMATS = (".csv", ".parquet")


@dataclass(frozen=True)
class ExportTable:
    """One of the tables: its columns, each of which may be empty in a row, and the rows of a case."""

    columns: dict[str, type]
    rows: Callable[[Record, Store], Iterable[ExportRow]]


def export(stores: Sequence[Store], path: Path, table: str = "cases") -> int:
    """Write one of `TABLES` to a file that ends in ``.csv`` or ``.parquet``; return the number of rows.

    Raises
    ------
    problems.errors.InputError
        For another ending or table, a directory without a run, the series of a report, or a missing
        library.
    """
    ensure_known(path, table)
    chosen, stored, count = TABLES[table], [(store, reading.records(store)) for store in stores], 0
    writer = _csv if path.suffix == ".csv" else _parquet
    with atomic(path) as temporary, writer(temporary, chosen.columns) as write:
        for store, records in stored:
            for record in records:
                rows = list(chosen.rows(record, store))
                write(rows)
                count += len(rows)
        if table == "series" and not count:
            raise InputError(f"{str(stores[0].directory)!r} is a report, which has no series; export a run.")
    return count


def ensure_known(path: Path, table: str) -> None:
    """Refuse a table or the ending of a file that `export` does not know.

    Raises
    ------
    problems.errors.InputError
        With those that it knows.
    """
    if table not in TABLES:
        raise unknown("table", table, TABLES)
    if path.suffix not in FORMATS:
        raise InputError(f"{str(path)!r} must end in {' or '.join(FORMATS)}.")


def as_json(records: Sequence[Record]) -> dict[str, Any]:
    """Return all about the cases as JSON values; numbers are finite or null with a reason."""
    metrics = {
        key: {"label": m.label, "unit": m.unit, "better": m.better, "description": m.description}
        for key, m in METRICS.items()
    }
    return {"metrics": metrics, "cases": [_as_json(record) for record in records]}


def _as_json(record: Record) -> dict[str, Any]:
    fields = msgspec.to_builtins(record)
    timing, result = record.timing, fields.pop("result")
    del fields["case"]  # without what is as by default
    timed = None if timing is None else timing.summary | fields["timing"]
    return {**_whole(record.case), **result, **fields, "timing": timed}


def _whole(declared: msgspec.Struct) -> dict[str, Any]:
    """Return a part of a campaign as JSON values with its defaults, which its file leaves out."""
    values = msgspec.structs.asdict(declared)
    return {key: _whole(v) if isinstance(v, msgspec.Struct) else v for key, v in values.items()}


@contextmanager
def _csv(path: Path, columns: dict[str, type]) -> Iterator[Callable[[list[ExportRow]], object]]:
    with path.open("wb") as stream:
        stream.write(csv_of([list(columns)]))
        yield lambda rows: stream.write(csv_of(rows))


@contextmanager
def _parquet(path: Path, columns: dict[str, type]) -> Iterator[Callable[[list[ExportRow]], None]]:
    try:
        import pyarrow
        from pyarrow.parquet import ParquetWriter
    except ImportError:
        raise MissingLibraryError(
            "Parquet needs the library pyarrow; install it with: pip install 'hbvm-bench[export]', "
            "or write a .csv."
        ) from None
    types = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64(), bool: pyarrow.bool_()}
    schema = pyarrow.schema([(name, types[kind]) for name, kind in columns.items()])

    def write(rows: list[ExportRow]) -> None:
        named = [dict(zip(columns, row, strict=True)) for row in rows]
        writer.write_table(pyarrow.Table.from_pylist(named, schema=schema))

    with ParquetWriter(path, schema) as writer:
        yield write


def _case(record: Record) -> ExportRow:
    return tuple(value(record) for _, value in CASES.values())


def _timings(record: Record, store: Store) -> Iterator[ExportRow]:
    del store
    for number, round_ in enumerate(record.timing.rounds if record.timing else []):
        calibration = median(round_.calibration) if round_.calibration else None
        rest = (round_.repeats, calibration, round_.share, round_.compile.seconds, round_.compile.cached)
        for sample, seconds in enumerate(round_.samples):
            yield (*_key(record), number, sample, seconds, *rest)


def _series(record: Record, store: Store) -> Iterator[ExportRow]:
    series = reading.drawn(record, store.series(record.id))
    for name, values in series.items():
        times = series.get("position_t" if name.startswith(("position", "phase")) else "t", np.empty(0))
        for i, parts in enumerate(values):
            t = float(times[i]) if len(times) == len(values) else None
            for component, value in enumerate(np.ravel(parts).tolist()):
                yield (*_key(record), name, i, component, t, float(value))


def _key(record: Record) -> ExportRow:
    return record.id, record.case.problem, record.case.method


def _json(value: Any) -> str:
    return msgspec.json.encode(value, order="deterministic").decode()


def _timed(value: Callable[[Timing], Any]) -> Callable[[Record], Any]:
    return lambda record: None if record.timing is None else value(record.timing)


def _metric(key: str) -> dict[str, tuple[type, Callable[[Record], Any]]]:
    """Return the three columns of a metric."""

    def evaluated(record: Record) -> Value:
        return record.result.metrics.get(key, Value())

    def number(record: Record) -> float | None:
        value = evaluated(record).value
        return None if value is None else float(value)

    excluded, why = (lambda record: evaluated(record).excluded), (lambda record: evaluated(record).why)
    return {key: (float, number), f"{key}_void": (bool, excluded), f"{key}_why": (str, why)}


def _calibration(timing: Timing) -> float | None:
    samples = [seconds for round_ in timing.rounds for seconds in round_.calibration]
    return median(samples) if samples else None


CASES: dict[str, tuple[type, Callable[[Record], Any]]] = {
    "id": (str, lambda record: record.id),
    "problem": (str, lambda record: record.case.problem),
    "method": (str, lambda record: record.case.method),
    "problem_name": (str, lambda record: parse_spec(record.case.problem).name),
    "problem_arguments": (str, lambda record: _json(parse_spec(record.case.problem).arguments)),
    "method_name": (str, lambda record: parse_spec(record.case.method).name),
    "method_options": (str, lambda record: _json(parse_spec(record.case.method).arguments)),
    "settings": (str, lambda record: record.case.settings),
    "note": (str, lambda record: record.case.note),
    "ensemble": (str, lambda record: _json(_whole(record.case.ensemble)) if record.case.ensemble else ""),
    "role": (str, lambda record: record.role),
    "library": (str, lambda record: record.library),
    "order": (int, lambda record: record.order),
    "outcome": (str, lambda record: record.result.outcome),
    "status": (str, lambda record: record.result.status),
    "reason": (str, lambda record: record.result.reason),
    "violation": (str, lambda record: record.result.violation),
    "warnings": (str, lambda record: " ".join(record.result.warnings)),
    "t_stop": (float, lambda record: record.result.t_stop),
    **{name: column for key in METRICS for name, column in _metric(key).items()},
    "time_median": (float, _timed(lambda timing: timing.summary.get("median"))),
    "time_min": (float, _timed(lambda timing: timing.summary.get("min"))),
    "time_q1": (float, _timed(lambda timing: timing.summary.get("q1"))),
    "time_q3": (float, _timed(lambda timing: timing.summary.get("q3"))),
    "time_rounds": (int, _timed(lambda timing: len(timing.rounds))),
    "time_samples": (int, _timed(lambda timing: len(timing.samples))),
    "time_why": (str, _timed(lambda timing: timing.why)),
    "time_share": (float, _timed(lambda timing: timing.share)),
    "time_calibration": (float, _timed(_calibration)),
    "time_machine": (str, _timed(lambda timing: _json(timing.machine))),
    "rejections": (int, lambda record: record.result.counters.rejections),
    "iterations": (int, lambda record: record.result.counters.iterations),
    "solver": (str, lambda record: record.result.counters.solver),
    "process_seconds": (float, lambda record: record.seconds),
    "process_peak_gib": (float, lambda record: record.peak_memory_gib),
    "versions": (str, lambda record: _json(record.versions)),
    "machine": (str, lambda record: _json(record.machine)),
    "finished": (str, lambda record: record.finished),
}
_KEY: dict[str, type] = {"id": str, "problem": str, "method": str}
_TIMINGS = {"round": int, "sample": int, "seconds": float, "repeats": int, "calibration": float}
_COMPILE = {"share": float, "compile_seconds": float, "compile_cached": bool}
_SERIES = {"quantity": str, "sample": int, "component": int, "t": float, "value": float}
TABLES = {
    "cases": ExportTable(
        {name: kind for name, (kind, _) in CASES.items()}, lambda record, _: [_case(record)]
    ),
    "timings": ExportTable(_KEY | _TIMINGS | _COMPILE, _timings),
    "series": ExportTable(_KEY | _SERIES, _series),
}
