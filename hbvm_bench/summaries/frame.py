"""The results as data frames of pandas: a row per case, per sample of time, or per number of its arrays.

pandas is imported here and nowhere else: whoever integrates does not wait for it.
"""

from collections.abc import Callable, Iterator, Sequence
from statistics import median
from typing import Any

import msgspec
import numpy as np

from hbvm_bench.campaign.identity import fixed_step, make_method
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.measure import machine, reading
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.store.records import Record, Timing, Value, machine_of
from hbvm_bench.store.store import Store, StoredRun
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.points import family_of, is_hbvm_or_gauss
from problems.errors import InputError, unknown

FIXED, ADAPTIVE = "fixed step size", "adaptive step size"
OURS = "HBVM and Gauss"
Frame = Any
"""A data frame of pandas, whose indexing has no types that a checker can follow."""
FrameRow = dict[str, Any]
KEY = ("id", "problem", "method")
INTEGERS = (
    *("order", "rejections", "iterations", "time_rounds", "time_samples"),
    *("round", "sample", "component", "repeats"),
)
FLOATS = (
    *("t_stop", "process_seconds", "process_peak_gib", "seconds", "calibration", "compile_seconds"),
    *("time_median", "time_min", "time_q1", "time_q3", "time_calibration", "t", "value"),
    *METRICS,
)
TRUTHS = ("compile_cached",)
EXCLUDED = "_void"  # how the column ends that says whether a metric must not be compared


def frame(stores: Sequence[Store], table: str = "cases") -> Frame:
    """Return the results of runs, one after the other: see `hbvm_bench.summaries.results.Results.frame`."""
    if table not in TABLES:
        raise unknown("table", table, TABLES)
    rows = [
        row for store in stores for record in reading.records(store) for row in TABLES[table](record, store)
    ]
    return framed(rows)


def cases(runs: Sequence[StoredRun]) -> Frame:
    """Return the results table that summaries are functions of: a row for each case of runs, in order.

    Its columns are those of `case`, and ``study``, ``processor`` (see
    `hbvm_bench.measure.machine.words`), ``place`` (a number for each problem of each run), ``title`` and
    ``within`` of the problem's entry, ``family``, ``side`` (the family, or HBVM and Gauss together),
    ``step_size`` (fixed or adaptive), and ``record`` with every sample of time.
    """
    rows, records, asked = [], [], []
    for number, run in enumerate(runs):
        campaign = run.index.campaign
        kind = machine.words(machine.kind(machine_of(run.records))) if run.records else ""
        for place, (entry, here) in enumerate(standings.entries(campaign, run.records)):
            for record in here:
                family = family_of(record)
                rows.append(
                    {
                        **case(record),
                        "study": campaign.name,
                        "processor": kind,
                        "place": f"{number}/{place}",
                        "title": standings.title_of(entry),
                        "family": family,
                        "side": OURS if is_hbvm_or_gauss(record) else family,
                        "step_size": step_size_of(record.case.method),
                    }
                )
                records.append(record)
                asked.append(entry.within)
    return framed(rows).assign(record=records, within=asked)


def step_size_of(method: str) -> str:
    """Return whether a method, as it prints, has a fixed or an adaptive step size."""
    try:
        return FIXED if fixed_step(make_method(method)) else ADAPTIVE
    except InputError:  # of a plugin or a library that is not here
        return "step size unknown"


def framed(rows: Sequence[FrameRow]) -> Frame:
    """Return rows as a data frame whose columns have the same types in every run."""
    import pandas as pd

    def kind(name: str) -> str:
        if name in INTEGERS:
            return "Int64"
        if name in FLOATS:
            return "Float64"
        return "boolean" if name in TRUTHS or name.endswith(EXCLUDED) else "string[python]"

    columns = {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}
    return pd.DataFrame({name: pd.array(values, dtype=kind(name)) for name, values in columns.items()})


def case(record: Record) -> FrameRow:
    """Return what is known of a case, as the columns of its row."""
    problem, method, result = parse_spec(record.case.problem), parse_spec(record.case.method), record.result
    asked = record.case.ensemble
    return {
        **_key(record),
        "problem_name": problem.name,
        "problem_arguments": _json(problem.arguments),
        "method_name": method.name,
        "method_options": _json(method.arguments),
        "settings": record.case.settings,
        "note": record.case.note,
        "ensemble": _json(msgspec.structs.asdict(asked)) if asked else "",
        "role": record.role,
        "library": record.library,
        "order": record.order,
        "outcome": result.outcome,
        "status": result.status,
        "reason": result.reason,
        "violation": result.violation,
        "warnings": " ".join(result.warnings),
        "t_stop": result.t_stop,
        **_metrics(record),
        **_times(record.timing or Timing()),
        "time_machine": None if record.timing is None else _json(record.timing.machine),
        "rejections": result.counters.rejections,
        "iterations": result.counters.iterations,
        "solver": result.counters.solver,
        "process_seconds": record.seconds,
        "process_peak_gib": record.peak_memory_gib,
        "versions": _json(record.versions),
        "machine": _json(record.machine),
        "finished": record.finished,
    }


def _metrics(record: Record) -> FrameRow:
    columns: FrameRow = {}
    for key in METRICS:
        value = record.result.metrics.get(key, Value())
        columns |= {key: value.value, f"{key}{EXCLUDED}": value.excluded, f"{key}_why": value.why}
    return columns


def _times(timing: Timing) -> FrameRow:
    loops = [seconds for round_ in timing.rounds for seconds in round_.calibration]
    return {
        **{f"time_{name}": timing.summary.get(name) for name in ("median", "min", "q1", "q3")},
        "time_rounds": len(timing.rounds),
        "time_samples": len(timing.samples),
        "time_why": timing.why,
        "time_calibration": median(loops) if loops else None,
    }


def _timings(record: Record, store: Store) -> Iterator[FrameRow]:
    del store
    for number, round_ in enumerate(record.timing.rounds if record.timing else []):
        for sample, seconds in enumerate(round_.samples):
            yield {
                **_key(record),
                "round": number,
                "sample": sample,
                "seconds": seconds,
                "repeats": round_.repeats,
                "calibration": median(round_.calibration) if round_.calibration else None,
                "compile_seconds": round_.compile.seconds,
                "compile_cached": round_.compile.cached,
            }


def _series(record: Record, store: Store) -> Iterator[FrameRow]:
    series = reading.drawn(record, store.series(record.id), store.known())
    for name, values in series.items():
        times = series.get("position_t" if name.startswith(("position", "phase")) else "t", np.empty(0))
        for i, parts in enumerate(values):
            t = float(times[i]) if len(times) == len(values) else None
            for component, value in enumerate(np.ravel(parts).tolist()):
                place = {"quantity": name, "sample": i, "component": component}
                yield {**_key(record), **place, "t": t, "value": float(value)}


def _key(record: Record) -> FrameRow:
    return dict(zip(KEY, (record.id, record.case.problem, record.case.method), strict=True))


def _json(value: Any) -> str:
    return msgspec.json.encode(value, order="deterministic").decode()


TABLES: dict[str, Callable[[Record, Store], Any]] = {
    "cases": lambda record, _: [case(record)],
    "timings": _timings,
    "series": _series,
}
