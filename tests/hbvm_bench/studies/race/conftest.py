import pytest

from hbvm_bench.studies.race.contests import CONTESTS
from hbvm_bench.studies.race.results import Load, Outcome, Probe, Race, Setting


def outcome(method, seconds, energy, position, family="hbvm", **more):
    """Return an outcome of three rounds about a median."""
    return Outcome(
        setting=Setting(family=family, method=method, default=more.pop("default", False)),
        status=more.pop("status", "finished"),
        energy=energy,
        position=position,
        samples=401,
        steps=100,
        call_seconds=1e-5,
        repeats=2,
        seconds=more.pop("times", [0.9 * seconds, seconds, 1.2 * seconds]),
        **more,
    )


@pytest.fixture
def race():
    return made_up()


def made_up():
    """Return a small race with every kind of row."""
    return Race(
        contest=CONTESTS["outer_solar_system"],
        t_end=1200.0,
        quick=True,
        outcomes=[
            outcome("Gauss(s=8, h=2.0)", 0.001, 2e-12, 1e-9),
            outcome("Gauss(s=8, h=1.5)", 0.002, 5e-14, 5e-11),
            outcome("HBVM(k=16, s=8, h=2.0)", 0.0015, 1e-14, 1e-8),
            outcome("Taylor(tol=1e-12)", 0.015, 3e-11, 2e-8, "heyoka"),
            outcome("Taylor()", 0.03, 2e-15, 1e-12, "heyoka", default=True),
            outcome("IAS15()", 0.0, None, None, "ias15", status="stalled", reason="stood still", times=[]),
            outcome("IAS15(mode='global')", 0.05, 1e-15, 1e-12, "ias15", void="another trajectory", times=[]),
            outcome("WHFast(h=0.5)", 0.006, 5e-11, 3e-9, "whfast", times=[None, 0.006, None]),
            outcome("Leapfrog(h=0.1)", 0.0, None, None, "leapfrog", status="refused", reason="no", times=[]),
        ],
        rounds=3,
        calibration=[0.0101, 0.01, 0.0102],
        probes=[
            Probe(
                family="hbvm",
                method="Gauss(s=8, h=2.0)",
                caches="empty",
                compile_seconds=[2.5, 2.4, 2.6],
                process_seconds=[3.5, 3.4, 3.6],
                from_cache=False,
            )
        ],
        reference={"method": "128 bits"},
        load=Load(others=0.2, stolen=0.0),
        machine={"processor": "<b>fast</b> | one"},
        versions={"numpy": "2"},
        command="hbvm-bench race --quick",
        started="2026-01-02T03:04:05+00:00",
        seconds=1.5,
    )
