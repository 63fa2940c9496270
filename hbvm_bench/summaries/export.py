"""A run for other tools: JSON, and flat tables as CSV or, with the extra ``hbvm-bench[export]``, Parquet."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.store.files import atomic, spreadsheet_text
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import opened
from hbvm_bench.summaries.frame import TABLES, frame
from problems.errors import InputError, MissingLibraryError, unknown

FORMATS = (".csv", ".parquet")


def export(places: Sequence[Path], path: Path, table: str = "cases") -> int:
    """Write a `frame` of runs to a file that ends in ``.csv`` or ``.parquet``; return the number of rows.

    Raises
    ------
    problems.errors.InputError
        For another ending or table, a place without a run or without arrays, or a missing library.
    """
    if table not in TABLES:  # before a run is opened
        raise unknown("table", table, TABLES)
    if path.suffix not in FORMATS:
        raise InputError(f"{str(path)!r} must end in {' or '.join(FORMATS)}.")
    rows = frame(opened(places), table)
    if table == "series" and rows.empty:
        raise InputError(f"{str(places[0])!r} is a report, which has no series; export a run.")
    with atomic(path) as temporary:
        if path.suffix == ".csv":
            texts = rows.select_dtypes("string").columns
            rows[texts] = rows[texts].map(spreadsheet_text, na_action="ignore")
            rows.to_csv(temporary, index=False, lineterminator="\n")
        else:
            try:
                rows.to_parquet(temporary, index=False)
            except ImportError:
                raise MissingLibraryError(
                    "Parquet needs the library pyarrow; install it with: pip install 'hbvm-bench[export]', "
                    "or write a .csv."
                ) from None
    return len(rows)


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
