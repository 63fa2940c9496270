"""Races that were run before a race was a campaign: ``DIR/<problem>.json``, read as records.

To be removed when the reports have been made again.
"""

import math
from pathlib import Path
from typing import Any

import msgspec

from hbvm_bench.campaign.file import Campaign, Case, name_of
from hbvm_bench.campaign.file import load as load_campaign
from hbvm_bench.campaign.identity import is_ours, make_method, make_problem
from hbvm_bench.campaign.shorter import chosen
from hbvm_bench.store.kept import Kept
from hbvm_bench.store.records import (
    Compile,
    Counters,
    Load,
    Record,
    Result,
    Timing,
    TimingRound,
    Value,
    decoded,
)
from hbvm_bench.store.store import Index
from hbvm_bench.studies.race.probe import Probe
from problems.errors import InputError

FAMILIES = {"hbvm": "", "heyoka": "Taylor", "ias15": "IAS15", "dop853": "DOP853"}
SCHEMA = 2


def load(directory: Path) -> list[tuple[Kept, list[Probe]]]:
    """Read the results of a directory.

    Raises
    ------
    problems.errors.InputError
        If a file is not a result.
    """
    declared = load_campaign("race")
    paths = {name_of(entry): directory / f"{name_of(entry)}.json" for entry in declared.entries()}
    return [_read(path, chosen(declared, [key])) for key, path in paths.items() if path.is_file()]


def _read(path: Path, campaign: Campaign) -> tuple[Kept, list[Probe]]:
    try:
        old = decoded(path.read_bytes(), dict[str, Any])
        if old["schema"] != SCHEMA or old["contest"]["key"] != path.stem:
            raise ValueError("another version, or another problem's")
        records = [_record(old, one) for one in old["outcomes"]]
        probes = [
            msgspec.convert(one | {"problem": path.stem, "family": FAMILIES[one["family"]]}, Probe)
            for one in old["probes"]
        ]
    except (msgspec.MsgspecError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{str(path)!r} is not the result of a race: {error}.") from None
    timing = msgspec.structs.replace(campaign.timing, rounds=old["rounds"])
    index = Index(
        campaign=msgspec.structs.replace(campaign, timing=timing),
        ids=[one.id for one in records],
        version=old["versions"]["hbvm-bench"],
        command=old["command"],
    )
    return Kept(index=index, records=records), probes


def _record(old: dict[str, Any], one: dict[str, Any]) -> Record:
    method = make_method(one["setting"]["method"])
    void, status = one["void"], one["status"]
    case = Case(problem=repr(make_problem(old["contest"]["problem"])), method=one["setting"]["method"])
    compiled = Compile(seconds=one["compile_seconds"] or 0.0, cached=one["from_cache"])
    rounds = [
        TimingRound(
            samples=[seconds],
            repeats=one["repeats"],
            compile=compiled,
            calibration=[old["calibration"][place]],
            number=place,
        )
        for place, seconds in enumerate(one["seconds"])
        if seconds is not None
    ]
    timing = Timing(
        rounds=rounds,
        why=one["untimed"],
        machine=old["machine"],
        process=old["started"],
        call=one["call_seconds"],
        load=None if old["load"] is None else msgspec.convert(old["load"], Load),
    )
    numbers = {
        "energy_max": one["energy"],
        "position_end": one["position"],
        "guard_max": one["guard"],
        "steps": one["steps"],
        "evaluations": one["evaluations"],
        "warm_seconds": timing.summary.get("median"),
    }
    outcome = status if status in ("refused", "crashed", "stalled") else "ok"
    return Record(
        id=one["setting"]["method"],
        case=case,
        role="ours" if is_ours(method) else "peer",
        library=method.library,
        order=method.order,
        result=Result(
            outcome=outcome,
            status="" if outcome in ("refused", "crashed") else status,
            reason=one["reason"],
            violation=void,
            counters=Counters(
                **{name: one[name] for name in ("steps", "rejections", "evaluations", "iterations", "solver")}
            ),
            metrics={
                key: Value(value=value, void=bool(void), why=void)
                for key, value in numbers.items()
                if value is not None and math.isfinite(value)
            },
            compile=compiled,
        ),
        timing=timing,
        versions=old["versions"],
        machine=old["machine"],
        finished=old["started"],
    )
