import msgspec
import pytest

from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.shorter import chosen, quick_run
from hbvm_bench.store.records import Counters, Load, Timing
from hbvm_bench.store.store import Index
from hbvm_bench.store.stored_run import StoredRun
from hbvm_bench.studies.race import results
from hbvm_bench.studies.race.probe import Probe
from hbvm_bench.studies.race.results import Race
from tests.hbvm_bench import made_up_run
from tests.hbvm_bench.made_up_run import archived, timed

MACHINE = {"processor": "<b>fast</b> | one"}
PROBLEM = repr(make_problem("outer_solar_system(t_end=1200.0)"))


def record(method, seconds, energy, position, **more):
    """Return a case of three rounds about a median."""
    times = more.pop("times", [0.9 * seconds, seconds, 1.2 * seconds])
    rounds = timed(times, calibration=[0.01])
    more["metrics"] = {"energy_max": energy, "position_end": position, "steps": 100.0}
    made = made_up_run.record(
        method,
        times,
        problem=PROBLEM,
        grid=results.declared().grid,
        counters=Counters(steps=100),
        library="",
        **more,
    )
    timing = Timing(
        rounds=rounds, machine=MACHINE, process="one", call=1e-5, load=Load(others=0.08, steal=0.0)
    )
    return msgspec.structs.replace(made, timing=timing if rounds else None)


@pytest.fixture
def race():
    return made_up()


def made_up(**said):
    """Return a small race with every kind of row, and what is said for machine, versions and command."""
    records = [
        record("Gauss(s=8, h=2.0)", 0.001, 2e-12, 1e-9),
        record("Gauss(s=8, h=1.5)", 0.002, 5e-14, 5e-11),
        record("HBVM(k=16, s=8, h=2.0)", 0.0015, 1e-14, 1e-8),
        record("Taylor(tol=1e-12)", 0.015, 3e-11, 2e-8),
        record("Taylor()", 0.03, 2e-15, 1e-12),
        record(
            "IAS15()", 0.0, None, None, outcome="stalled", status="stalled", reason="stood still", times=[]
        ),
        record("IAS15(mode='global')", 0.05, 1e-15, 1e-12, violation="another trajectory", times=[]),
        record("WHFast(h=0.5)", 0.006, 5e-11, 3e-9, times=[None, 0.006, None]),
        record("Leapfrog(h=0.1)", 0.0, None, None, outcome="refused", status="", reason="no", times=[]),
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
    campaign = quick_run(chosen(results.declared(), ["outer_solar_system"]))
    index = Index(
        campaign=campaign,
        ids=[one.id for one in records],
        version="0",
        command=said.get("command", "hbvm-bench race --quick"),
        cases=[one.case for one in records],
    )
    probes = [
        Probe(
            problem="outer_solar_system",
            family="",
            method="Gauss(s=8, h=2.0)",
            caches="empty",
            compile_seconds=[2.5, 2.4, 2.6],
            process_seconds=[3.5, 3.4, 3.6],
            from_cache=False,
        )
    ]
    (entry,) = campaign.entries()
    return Race(entry, StoredRun(index=index, records=records), records, probes)


def save(race, directory):
    """Keep a race in a directory, as the command does."""
    archived(directory, race.run)
