"""A run for other tools: JSON, and flat tables as CSV or, with the extra ``hbvm-bench[export]``, Parquet."""

import csv
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import msgspec
import numpy as np

from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.measure import reading
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.store.files import atomic, csv_of
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Store, damage
from problems.errors import InputError, MissingLibraryError, unknown

Row = dict[str, Any]
FORMATS = (".csv", ".parquet")


@dataclass(frozen=True)
class Table:
    """One of the tables."""

    columns: dict[str, type]  # by name; every column may be empty in a row
    rows: Callable[[Record, Store], Iterator[Row]]


def export(store: Store, path: Path, table: str = "cases") -> int:
    """Write a table of a run and return the number of its rows.

    Parameters
    ----------
    store : Store
        The run.
    path : pathlib.Path
        Its ending says the format: ``.csv`` or ``.parquet``.
    table : {"cases", "timings", "series"}
        One row per case, per timing sample, or per number in a series.

    Raises
    ------
    problems.errors.InputError
        For another ending or table, a directory without a run, or a missing library.
    """
    if table not in TABLES:
        raise unknown("table", table, TABLES)
    if path.suffix not in FORMATS:
        raise InputError(f"{str(path)!r} must end in {' or '.join(FORMATS)}.")
    chosen, records, count = TABLES[table], reading.records(store), 0
    writer = _csv if path.suffix == ".csv" else _parquet
    with atomic(path) as temporary, writer(temporary, chosen.columns) as write:
        for record in records:
            rows = list(chosen.rows(record, store))
            write(rows)
            count += len(rows)
    return count


def cases_csv(records: Sequence[Record]) -> bytes:
    """Return the table of cases as comma-separated text."""
    names = CASE_COLUMNS.keys()
    return csv_of([names, *([row.get(name) for name in names] for row in map(_case_row, records))])


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


def _whole(declared: msgspec.Struct) -> Row:
    """Return a part of a campaign as JSON values with its defaults, which its file leaves out."""
    values = msgspec.structs.asdict(declared)
    return {key: _whole(v) if isinstance(v, msgspec.Struct) else v for key, v in values.items()}


@contextmanager
def _csv(path: Path, columns: dict[str, type]) -> Iterator[Callable[[list[Row]], None]]:
    with path.open("w", encoding="utf-8", newline="") as stream:
        made = csv.DictWriter(stream, list(columns))
        made.writeheader()
        yield made.writerows


@contextmanager
def _parquet(path: Path, columns: dict[str, type]) -> Iterator[Callable[[list[Row]], None]]:
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
    with ParquetWriter(path, schema) as writer:
        yield lambda rows: writer.write_table(pyarrow.Table.from_pylist(rows, schema=schema))


def _key(record: Record) -> Row:
    return {"id": record.id, "problem": record.case.problem, "method": record.case.method}


def _case_row(record: Record) -> Row:
    case, result, timing = record.case, record.result, record.timing
    row = _key(record) | {
        "problem_name": parse_spec(case.problem).name,
        "problem_arguments": _json(parse_spec(case.problem).arguments),
        "method_name": parse_spec(case.method).name,
        "method_options": _json(parse_spec(case.method).arguments),
        "settings": case.settings,
        "note": case.note,
        "ensemble": "" if case.ensemble is None else _json(_whole(case.ensemble)),
        "role": record.role,
        "library": record.library,
        "order": record.order,
        "outcome": result.outcome,
        "status": result.status,
        "reason": result.reason,
        "violation": result.violation,
        "warnings": " ".join(result.warnings),
        "t_stop": result.t_stop,
    }
    for key in METRICS:
        value = result.metrics.get(key)
        number = None if value is None or value.value is None else float(value.value)
        row |= {key: number, f"{key}_void": value is not None and value.void}
        row[f"{key}_why"] = "" if value is None else value.why
    if timing is not None:
        rounds = timing.rounds
        row |= {f"time_{name}": number for name, number in timing.summary.items()}
        row |= {"time_rounds": len(rounds), "time_samples": len(timing.samples), "time_why": timing.why}
        row |= {"time_share": timing.share, "time_machine": _json(timing.machine)}
        if calibration := [seconds for one in rounds for seconds in one.calibration]:
            row["time_calibration"] = median(calibration)
    counters = result.counters
    row |= {"rejections": counters.rejections, "iterations": counters.iterations, "solver": counters.solver}
    row |= {"process_seconds": record.seconds, "process_peak_gib": record.peak_memory_gib}
    row |= {"versions": _json(record.versions), "machine": _json(record.machine)}
    return row | {"finished": record.finished}


def _timings(record: Record, store: Store) -> Iterator[Row]:
    del store
    for number, one in enumerate(record.timing.rounds if record.timing else []):
        for sample, seconds in enumerate(one.samples):
            yield _key(record) | {
                "round": number,
                "sample": sample,
                "seconds": seconds,
                "repeats": one.repeats,
                "calibration": median(one.calibration) if one.calibration else None,
                "share": one.share,
                "compile_seconds": one.compile.seconds,
                "compile_cached": one.compile.cached,
            }


def _series(record: Record, store: Store) -> Iterator[Row]:
    series = store.series(record.id)
    if why := damage(record, series, make_problem(record.case.problem).system.dim):
        yield _key(record) | {"quantity": f"damaged: {why}"}
        return
    for name, values in series.items():
        times = series["position_t" if name.startswith(("position", "phase")) else "t"]
        for i, parts in enumerate(values):
            for component, value in enumerate(np.ravel(parts).tolist()):
                yield _key(record) | {
                    "quantity": name,
                    "sample": i,
                    "component": component,
                    "t": float(times[i]) if len(times) == len(values) else None,
                    "value": float(value),
                }


def _json(value: Any) -> str:
    return msgspec.json.encode(value, order="deterministic").decode()


def _case_columns() -> dict[str, type]:
    words = ("problem_name", "problem_arguments", "method_name", "method_options", "settings", "note")
    keys = ("id", "problem", "method", *words, "ensemble", "role", "library")
    columns: dict[str, type] = dict.fromkeys(keys, str)
    columns |= {"order": int} | dict.fromkeys(("outcome", "status", "reason", "violation", "warnings"), str)
    columns["t_stop"] = float
    for key in METRICS:
        columns |= {key: float, f"{key}_void": bool, f"{key}_why": str}
    columns |= dict.fromkeys(("time_median", "time_min", "time_q1", "time_q3"), float)
    columns |= {"time_rounds": int, "time_samples": int, "time_why": str, "time_share": float}
    columns |= {"time_calibration": float, "time_machine": str}
    columns |= {"rejections": int, "iterations": int, "solver": str}
    columns |= {"process_seconds": float, "process_peak_gib": float}
    return columns | dict.fromkeys(("versions", "machine", "finished"), str)


CASE_COLUMNS = _case_columns()
_KEY: dict[str, type] = {"id": str, "problem": str, "method": str}
TABLES = {
    "cases": Table(CASE_COLUMNS, lambda record, store: iter([_case_row(record)])),
    "timings": Table(
        _KEY
        | {"round": int, "sample": int, "seconds": float, "repeats": int, "calibration": float}
        | {"share": float, "compile_seconds": float, "compile_cached": bool},
        _timings,
    ),
    "series": Table(
        _KEY | {"quantity": str, "sample": int, "component": int, "t": float, "value": float}, _series
    ),
}
