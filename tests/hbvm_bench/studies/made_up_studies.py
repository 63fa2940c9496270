"""Studies that nobody ran: a race, a comparison of defaults, and a long run, with made-up numbers."""

import msgspec
import numpy as np

from hbvm_bench.campaign.file import load
from hbvm_bench.campaign.identity import is_ours, make_problem, resolve
from hbvm_bench.campaign.shorter import chosen, quick_run, with_rounds
from hbvm_bench.store.records import Counters, Load, Timing
from hbvm_bench.store.store import Index, Store, StoredRun
from tests.hbvm_bench import made_up_run
from tests.hbvm_bench.made_up_run import timed

MACHINE = {"processor": "<b>fast</b> | one"}
PROBLEM = repr(make_problem("outer_solar_system(t_end=1200.0)"))
OURS, PEER = "Gauss(s=8, h=1.0)", "Taylor(tol=1e-16)"


def setting(method, seconds, energy, position, **more):
    """Return a case of the race, of three rounds about a median."""
    times = more.pop("times", [0.9 * seconds, seconds, 1.2 * seconds])
    rounds = timed(times, calibration=[0.01])
    more["metrics"] = {"energy_max": energy, "position_end": position, "steps": 100.0}
    grid, counters = load("race").grid, Counters(steps=100)
    made = made_up_run.record(
        method, times, problem=PROBLEM, grid=grid, counters=counters, library="", **more
    )
    load_ = Load(others=0.08, steal=0.0)
    timing = Timing(rounds=rounds, machine=MACHINE, process="one", call=1e-5, load=load_)
    return msgspec.structs.replace(made, timing=timing if rounds else None)


def race(*more, **said):
    """Return a small race with every kind of row, and what is said for machine, versions and command."""
    lost = "another trajectory"
    records = [
        setting("Gauss(s=8, h=2.0)", 0.001, 2e-12, 1e-9),
        setting("Gauss(s=8, h=1.5)", 0.002, 5e-14, 5e-11),
        setting("HBVM(k=16, s=8, h=2.0)", 0.0015, 1e-14, 1e-8),
        setting("Taylor(tol=1e-12)", 0.015, 3e-11, 2e-8),
        setting("Taylor()", 0.03, 2e-15, 1e-12),
        setting("IAS15()", 0.0, None, None, outcome="stalled", status="stalled", reason="still", times=[]),
        setting("IAS15(mode='global')", 0.05, 1e-15, 1e-12, violation=lost, times=[]),
        setting("WHFast(h=0.5)", 0.006, 5e-11, 3e-9, times=[None, 0.006, None]),
        setting("Leapfrog(h=0.1)", 0.0, None, None, outcome="refused", status="", reason="no", times=[]),
        *more,
    ]
    if "machine" in said:
        records = [
            msgspec.structs.replace(
                one,
                timing=one.timing and msgspec.structs.replace(one.timing, machine=said["machine"]),
                versions=said.get("versions", one.versions),
            )
            for one in records
        ]
    index = Index(
        campaign=quick_run(chosen(load("race"), ["outer_solar_system"])),
        ids=[one.id for one in records],
        version="0",
        command=said.get("command", "hbvm-bench race --quick"),
        cases=[one.case for one in records],
    )
    return StoredRun(index=index, records=records)


def defaults(machine, ratio=2.0, problem="kepler", worse=1.0):
    """Return a run of two rounds of `automatic` on one problem."""
    campaign, records = with_rounds(chosen(load("automatic"), [problem]), 2), []
    for case in map(resolve, campaign.cases()):
        ours = is_ours(case.method)
        times = [1.0, 1.1] if ours else [ratio, 1.1 * ratio]
        metrics = {
            "energy_max": 1e-15 * (worse if ours else 2.0),
            "position_mean": 1e-12 * (1.0 if ours else 2.0),
            "steps": 10.0,
        }
        timing = Timing(rounds=timed(times), machine=machine)
        records.append(made_up_run.record(case, times, metrics=metrics, timing=timing))
    index = Index(
        campaign=campaign, ids=[one.id for one in records], version="0", command="hbvm-bench automatic"
    )
    return StoredRun(index=index, records=records)


def endurance(directory, starts=16, size=1e-17, bias=0.0, failed=0):
    """Store a run of `endure` whose errors are random walks, of two methods, and return its store."""
    declared = load("endure")
    methods = [msgspec.structs.replace(declared.methods[0], use=[OURS, PEER])]
    checks = msgspec.structs.replace(declared.checks, starts=starts)
    campaign = msgspec.structs.replace(declared, methods=methods, checks=checks)
    store = Store(directory)
    store.prepare()
    rng, cases = np.random.default_rng(7), [resolve(case) for case in campaign.cases()]
    t = cases[0].case.grid.times(cases[0].problem)
    for case, seconds in zip(cases, (0.5, 9.0), strict=True):
        steps = rng.standard_normal((starts, t.size - 1)) * np.sqrt(np.diff(t))
        errors = (size * np.cumsum(steps, axis=1) + bias * t[1:])[: starts - failed * (seconds > 1.0)]
        series = {
            "t": t,
            "y": np.tile(case.problem.y0, (t.size, 1)),
            "drift.t": t[1:],
            "drift.energy": errors,
        }
        timing = Timing(rounds=timed([seconds]), machine={"processor": "one"})
        made = made_up_run.record(case, t_stop=float(t[-1]), timing=timing, machine={"processor": "one"})
        store.save(made, series)
    ids = [case.id for case in cases]
    store.write_index(Index(campaign=campaign, ids=ids, version="0", command="hbvm-bench endure"))
    return store
