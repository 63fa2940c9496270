"""Runs that nobody ran: records and series made up, for the tests of the reports."""

import hashlib
import sys
from pathlib import Path
from statistics import median

import msgspec
import numpy as np

import problems
from hbvm_bench.campaign.file import Campaign, Case, Grid, MethodEntry, TimingPlan
from hbvm_bench.campaign.identity import Resolved, resolve
from hbvm_bench.measure import machine, raw, reading
from hbvm_bench.reference import solutions
from hbvm_bench.report.page import Results
from hbvm_bench.store.records import Compile, Counters, Record, Result, Timing, TimingRound, Value
from hbvm_bench.store.store import PACKED, Index, Store
from integrators.protocol import Stats, Status
from integrators.solution import Solution

HOSTILE = '<script>alert("1")</script> | `code` *bold* \\ [x](javascript:1) ' + "very long " * 50 + "\n# head"
METHODS = (
    "HBVM(k=16, s=8, h=0.125)",
    "HBVM(k=18, s=2, h=0.5)",
    'IAS15(mode="global")',
    "IAS15()",
    "Leapfrog(h=0.02, order=8)",
    "Radau(rtol=1e-6, atol=1e-8)",
)

COMPILED = Compile(seconds=0.1, cached=True)


def record(case="m()", times=(), **given):
    """Return a record that nobody measured.

    ``case`` is the text of a method, a case or a resolved one; ``times`` are the seconds of interleaved
    rounds, ``None`` for one that it was left out of. What is given goes to the record, its case or its
    result, whichever has a field of the name; metrics may be numbers, and those that are ``None`` are left
    out. All metrics are excluded where a violation is given.
    """
    mine = {struct: {key: given.pop(key) for key in struct.__struct_fields__ if key in given}
            for struct in (Case, Result)}  # fmt: skip
    if isinstance(case, Resolved):
        given = {"id": case.id, "library": case.method.library} | given
        case = case.case
    if isinstance(case, str):
        case = Case(**{"problem": "p()", "method": case} | mine[Case])
    result = {"outcome": "ok", "status": "finished", "metrics": {}} | mine[Result]
    rounds = timed(times)
    seconds = {"warm_seconds": median(one.samples[0] for one in rounds)} if rounds else {}
    why = result.get("violation", "")
    result["metrics"] = {
        key: one if isinstance(one, Value) else Value(value=one, excluded=bool(why), why=why)
        for key, one in (seconds | result["metrics"]).items()
        if one is not None
    }
    fields = {
        "id": hashlib.sha256(f"{case.problem}{case.method}".encode()).hexdigest(),
        "role": "ours" if case.method.startswith(("HBVM(", "Gauss(")) else "peer",
        "library": "x",
        "order": None,
        "timing": Timing(rounds=rounds) if rounds else None,
        "versions": {"numpy": "2"},
        "finished": "2026-01-02T03:04:05+00:00",
    }
    return Record(case=case, result=Result(**result), **fields | given)


def timed(times, calibration=()):
    """Return interleaved rounds of one sample each; ``None`` for one that was left out."""
    return [
        TimingRound(samples=[one], repeats=1, compile=COMPILED, calibration=list(calibration), number=place)
        for place, one in enumerate(times)
        if one is not None
    ]


def made_up(method, number):
    """Return a record with the reference's own states, spoilt in a way that depends on the method."""
    problem = problems.load("sitnikov")
    known = solutions.find(problem)
    assert known is not None
    resolved = resolve(Case(problem="sitnikov()", method=method, grid=Grid(step=25.0)))
    stalled, lost = method == "IAS15()", method.startswith("Radau")
    t = known.t[:3] if stalled else known.t
    y = known.high[: t.size].copy()
    y[1:, 0] += 1e-11 * 10.0**number
    y[1:, 7] = 3.0 if lost else 0.0
    if method.startswith("HBVM(k=18"):
        y[-1, 8] = -600.0  # far beyond what the view in space can show
    status = Status.STALLED if stalled else Status.FINISHED
    history = np.array([[0.0, 1e-1], [8.0, 1e-9], [8.5, 1e-20]])
    stats = Stats(steps=100, evaluations=None, extra={"dt_history": history} if stalled else {})
    solution = Solution(
        t=t,
        y=y,
        status=status,
        reason="",
        t_stop=float(t[-1]),
        stats=stats,
        compile_seconds=0.1,
        from_cache=False,
        problem=problem,
        method=resolved.method,
    )
    result, series = raw.of_solution(solution)
    visit = TimingRound(samples=[0.01 * (number + 1), 0.02], repeats=2, compile=COMPILED)
    timing = None if stalled else Timing(rounds=[visit])
    result = msgspec.structs.replace(result, reason=HOSTILE if stalled else "")
    made = msgspec.structs.replace(
        record(resolved, timing=timing, versions={"python": "3"}, machine={"cores": 2}), result=result
    )
    return reading.read(made, series), series


def raw_of(result):
    """Return a result as a worker returns it."""
    return msgspec.structs.replace(result, metrics={}, violation="", growth={})


def sitnikov(store):
    """Put a run on Sitnikov's problem into a store: hostile words, one case stalled, one off the axis."""
    store.prepare()
    ids = []
    for number, method in enumerate(METHODS):
        made, series = made_up(method, number)
        store.save(msgspec.structs.replace(made, result=raw_of(made.result)), series)
        ids.append(made.id)
    notes = {4: HOSTILE}
    campaign = Campaign(
        name="x",
        title=HOSTILE,
        description=HOSTILE,
        problems=["sitnikov()"],
        methods=[
            MethodEntry(
                use=method,
                note=notes.get(n, ""),
                settings="as published" if "k=18" in method else "recommended",
            )
            for n, method in enumerate(METHODS)
        ],
        grid=Grid(step=25.0),
    )
    store.write_index(Index(campaign=campaign, ids=ids, version="0", command=f"hbvm-bench run {HOSTILE}"))
    return store


OURS = ("Gauss(s=3, h={:.4g})", "HBVM(k=6, s=3, h={:.4g})")
ADAPTIVE = ("Taylor(tol={:.3g})", "IAS15(epsilon={:.3g})", "DOP853(rtol={:.3g}, atol=1e-14)")


def methods(count):
    """Return so many different methods of several families."""
    made = []
    for number in range(count):
        step = 1e-3 * (1 + number)
        for_peers = number % 5 - 2
        made.append(
            ADAPTIVE[for_peers].format(step * 1e-9) if for_peers >= 0 else OURS[number % 5].format(step)
        )
    return made


def write(store, texts, count, *, missing=0):
    """Put a run of made-up cases into a store: errors that grow in known ways, some failures."""
    store.prepare()
    names, rng, here = methods(count), np.random.default_rng(1), machine.describe()
    t = np.linspace(0.0, 100.0, 201)
    ids = []
    for problem in texts:
        for number, method in enumerate(names):
            resolved = resolve(Case(problem=problem, method=method))
            ids.append(resolved.id)
            if len(ids) <= missing:
                continue
            size, stalled = 10.0 ** rng.uniform(-16, -4), number % 17 == 16
            y = np.sin(t[:, None] + size * np.arange(1, resolved.problem.system.dim + 1))
            error = size * np.sqrt(t / t[-1]) * (1 + 0.1 * rng.standard_normal(t.size)) ** 2
            values = {"position_end": 30 * size, "energy_max": size, "warm_seconds": 1e-3 / size**0.1}
            metrics = {
                key: Value(value=value, excluded=stalled, why="only to t = 50" if stalled else "")
                for key, value in {**values, "distance_max": 1.0, "steps": 100.0 + number}.items()
            }
            cold = Compile(seconds=0.1, cached=False)
            timing = Timing(
                rounds=[TimingRound(samples=[values["warm_seconds"]], repeats=2, compile=cold)],
                plan=TimingPlan(rounds=1),
                machine=here,
                process="one",
            )
            made = record(
                resolved,
                outcome="stalled" if stalled else "ok",
                status="stalled" if stalled else "finished",
                reason="its step fell to 1e-20" if stalled else "",
                t_stop=50.0 if stalled else 100.0,
                counters=Counters(steps=100 + number),
                metrics=metrics,
                timing=None if stalled else timing,
                versions={"python": "3"},
                machine={"cores": 2},
            )
            nowhere = dict.fromkeys(("position_t", "position", "phase"), np.empty(0))
            store.save(made, {"t": t, "y": y, "error.energy": error, "distance": np.ones_like(t), **nowhere})
    campaign = Campaign(
        name="large",
        title="A large campaign",
        description="Made up.",
        problems=list(texts),
        methods=[MethodEntry(use=name) for name in names],
        timing=TimingPlan(rounds=1),
    )
    store.write_index(Index(campaign=campaign, ids=ids, version="0", command="hbvm-bench run large"))
    return store


def finish(store, campaign):
    """Put every case of a campaign into a store, timed by its plan, so that nothing is left to run."""
    store.prepare()
    here, rng = machine.describe(measure=True), np.random.default_rng(1)
    for number, resolved in enumerate(map(resolve, campaign.cases())):
        t = resolved.case.grid.times(resolved.problem)
        series = {"t": t, "y": np.tile(resolved.problem.y0, (t.size, 1))}
        if starts := campaign.checks.starts:
            series["drift.t"] = t[1:]
            series["drift.energy"] = np.cumsum(1e-16 * rng.standard_normal((starts, t.size - 1)), axis=1)
        timing = Timing(
            rounds=timed([0.01 + 0.001 * number] * campaign.timing.rounds, calibration=[0.01]),
            plan=campaign.timing,
            machine=here,
            process="one",
        )
        store.save(record(resolved, t_stop=float(t[-1]), timing=timing, counters=Counters(steps=1)), series)


def kepler(count):
    """Return so many problems."""
    return [f"kepler(e={0.1 + 0.8 * number / count:.6f})" for number in range(count)]


def toml(campaign):
    """Return the file of a campaign of problems and methods."""
    entries = "".join(f"[[methods]]\nuse = {entry.use!r}\n" for entry in campaign.methods)
    return f"name = {campaign.name!r}\nproblems = {campaign.problems!r}\n{entries}[timing]\nrounds = 1\n"


def results_of(*runs, computed=None):
    """Return what a page is made of, from runs that nobody ran."""
    return Results(
        list(runs), [record for run in runs for record in run.records], {}, computed=computed or {}
    )


def archived(directory, *runs):
    """Put runs that nobody ran into the store of a report."""
    store = Store()
    for store.run, run in enumerate(runs, 1):
        index = run.index
        if len(index.ids) != len(index.cases or index.campaign.cases()):
            ids, cases = [one.id for one in run.records], [one.case for one in run.records]
            index = msgspec.structs.replace(index, ids=ids, cases=cases)
        store.write_index(index)
        for one in run.records:
            store.save(one)
    directory.mkdir(parents=True, exist_ok=True)
    (directory / PACKED).write_bytes(store.packed())


if __name__ == "__main__":  # python -m tests.hbvm_bench.made_up_run DIRECTORY CASES
    folder, cases = Path(sys.argv[1]), int(sys.argv[2])
    made = write(Store(folder), kepler(cases // 100), 100)
    (folder / "campaign.toml").write_text(toml(made.index().campaign))
