"""The doctor says what is missing and when times are doubtful."""

import itertools
import json
from importlib.metadata import PackageNotFoundError

import pytest

import integrators.registry
from hbvm_bench import cli
from hbvm_bench.measure import doctor, machine


def test_everything_that_is_installed_has_its_version():
    found = {one.subject: one for one in doctor.examine(calibration=False)["installed"]}
    peers = {"heyoka", "rebound", "diffrax", "pyhamsys", "scikit-sundae", "pynamicalsys", "jax"}
    assert {"hbvm-bench", "distributed", "pyarrow"} | peers == found.keys()
    assert all(one.observed for one in found.values())
    assert found["hbvm-bench"].state == "ok"


def test_a_missing_peer_is_bad_and_a_missing_extra_is_a_note(monkeypatch):
    def version(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(doctor, "version", version)
    found = {one.subject: one for one in doctor.libraries()}
    assert (found["heyoka"].state, found["pyarrow"].state) == ("bad", "note")
    assert (found["pynamicalsys"].state, found["pynamicalsys"].advice) == ("note", "pip install pynamicalsys")
    assert found["rebound"].advice == "pip install 'hbvm-bench[peers]'"
    assert not doctor.healthy({"installed": list(found.values())})


def test_methods_of_third_parties_are_listed_and_broken_ones_are_bad(toys, monkeypatch):
    found = {one.subject: one for one in doctor.methods()}
    assert (found["Steady"].state, found["Steady"].observed) == ("ok", "toys 1.0")
    assert "HBVM" not in found

    def get(name):
        raise RuntimeError("half-installed")

    monkeypatch.setattr(integrators.registry, "get", get)
    broken = {one.subject: one for one in doctor.methods()}
    assert broken["Steady"].state == "bad"
    assert "RuntimeError: half-installed" in broken["Steady"].observed


@pytest.mark.parametrize(
    ("finding", "state"),
    [
        (doctor.scatter([0.01 * (1 + 0.0001 * i) for i in range(60)]), "ok"),
        (doctor.scatter([0.01 * (1 + 0.01 * i) for i in range(60)]), "bad"),
        (doctor.share(0.999), "ok"),
        (doctor.share(0.9), "bad"),
        (doctor.steal(0.0), "ok"),
        (doctor.steal(0.02), "bad"),
    ],
)
def test_times_are_doubtful_where_the_same_computation_varies_or_shares_its_core(finding, state):
    assert finding.state == state
    assert bool(finding.advice) == (state == "bad")


def test_what_else_runs_is_seen(monkeypatch):
    monkeypatch.setattr(doctor, "_running", lambda: 1)
    assert doctor.load().state == "ok"
    monkeypatch.setattr(doctor, "_running", lambda: 3)
    assert (doctor.load().state, doctor.load().observed[:29]) == ("bad", "2 other processes want to run")
    some = itertools.cycle([1, 1, 2])  # what runs for a moment only
    monkeypatch.setattr(doctor, "_running", lambda: next(some))
    assert doctor.load().state == "ok"


def test_governors_are_read_where_the_system_shows_them(monkeypatch, tmp_path):
    monkeypatch.setattr(doctor, "SYSTEM", tmp_path)
    assert "not visible" in doctor.governor().observed
    assert "not visible" in doctor.boost().observed
    for core, name in enumerate(("performance", "powersave")):
        path = tmp_path / f"cpu{core}" / "cpufreq" / "scaling_governor"
        path.parent.mkdir(parents=True)
        path.write_text(f"{name}\n")
    assert (doctor.governor().observed, doctor.governor().state) == ("performance, powersave", "note")
    (tmp_path / "cpu1/cpufreq/scaling_governor").write_text("performance\n")
    assert doctor.governor().state == "ok"
    (tmp_path / "cpufreq").mkdir()
    (tmp_path / "cpufreq/boost").write_text("0\n")
    assert doctor.boost().state == "ok"


def test_one_core_is_not_enough(monkeypatch):
    monkeypatch.setattr(machine, "cores", lambda: [0])
    assert doctor.cores().state == "bad"
    monkeypatch.setattr(machine, "cores", lambda: [0, 1])
    monkeypatch.setattr(doctor, "_quota", lambda: 1.5)
    assert doctor.cores().state == "bad"
    monkeypatch.setattr(doctor, "_quota", lambda: None)
    assert doctor.cores().state == "ok"


def test_the_calibration_runs_on_one_core_and_gives_the_others_back():
    before = machine.cores()
    seen = []

    def measure():
        seen.append(machine.cores())
        return 0.01

    findings = doctor.steadiness(measure)
    assert [one.subject for one in findings][:2] == ["calibration", "share"]
    assert set(map(tuple, seen)) == {(before[-1],)}
    assert machine.cores() == before


@pytest.mark.parametrize("bad", [False, True])
def test_the_command_says_it_and_its_exit_code_too(monkeypatch, capsys, bad):
    state = "bad" if bad else "ok"
    findings = {
        "installed": [doctor.Finding("heyoka", "ok", "7")],
        "timings": [doctor.Finding("load", state, "x")],
    }
    monkeypatch.setattr(doctor, "examine", lambda: findings)
    assert cli.main(["doctor"]) == int(bad)
    assert ("doubtful" if bad else "can be trusted") in capsys.readouterr().out
    assert cli.main(["doctor", "--json"]) == int(bad)
    assert json.loads(capsys.readouterr().out)["healthy"] is not bad
