"""What a resumed integration tells, and what is kept where nothing can be written."""

import threading
from importlib.metadata import EntryPoint

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, Radau, Status, Taylor, integrate, registry
from integrators.running import watch as running
from problems import InputError, Problem, VectorField


def heat(n):
    """Return a stiff chain whose Jacobian is sparse."""

    def field(y, m):
        inner = [400.0 * (y[i - 1] - 2.0 * y[i] + y[i + 1]) for i in range(1, n - 1)]
        return [-(y[0] ** 3), *inner, -y[n - 1]]

    return Problem(VectorField(field, dim=n, name="heat"), y0=np.linspace(1.0, 0.0, n) ** 2, t_end=1.0)


def stopped_in_the_middle(problem, method, times, path):
    """Return what is left of an integration that Ctrl-C stops after a third of its time."""

    def stop(progress):
        if progress.fraction > 0.3:
            raise KeyboardInterrupt

    return integrate(problem, method, times, checkpoint=path, every_seconds=0.0, progress=stop)


def test_radau_goes_on_from_a_checkpoint_of_a_large_sparse_system(tmp_path):
    problem, method, times = heat(140), Radau(rtol=1e-6, atol=1e-8), np.linspace(0.0, 1.0, 41)
    whole = integrate(problem, method, times)
    stopped_in_the_middle(problem, method, times, tmp_path / "kept")
    resumed = integrate(problem, method, times, resume=tmp_path / "kept")
    assert np.array_equal(resumed.y, whole.y)
    assert resumed.stats.steps == whole.stats.steps


def test_a_resumed_solution_tells_what_happened_before_the_break(tmp_path):
    def field(t, y, m):
        return [m.abs(m.sin(y[1])) - 0.1 * y[0], m.where(y[0] > 0.3, 1.0, 2.0)]

    problem = Problem(VectorField(field, dim=2, name="kinked"), y0=[0.0, 0.0], t_end=30.0)
    times = np.linspace(0.0, 30.0, 301)
    whole = integrate(problem, HBVM(), times)
    assert whole.stats.extra["kinks"]

    def late(progress):
        if progress.fraction > 0.9:
            raise KeyboardInterrupt

    integrate(problem, HBVM(), times, checkpoint=tmp_path / "kept", every_seconds=0.0, progress=late)
    resumed = integrate(problem, HBVM(), times, resume=tmp_path / "kept")
    assert np.array_equal(resumed.y, whole.y)
    assert resumed.warnings == whole.warnings
    assert resumed.stats.extra["kinks"] == whole.stats.extra["kinks"]
    assert (resumed.stats.extra["k"], resumed.stats.extra["s"]) == (
        whole.stats.extra["k"], whole.stats.extra["s"],
    )  # fmt: skip


def test_counters_add_up_and_settings_do_not():
    before = {
        "k": 4,
        "side": 2,
        "lanes": True,
        "implicit": {"steps": 3, "jacobian": "traced"},
        "kinks": [(1.0, 0.1)],
    }
    now = {
        "k": 4,
        "side": 5,
        "lanes": True,
        "implicit": {"steps": 4, "jacobian": "traced"},
        "kinks": [(2.0, 0.1)],
    }
    assert running._with_those_before(now, before) == {
        "k": 4, "side": 7, "lanes": True, "implicit": {"steps": 7, "jacobian": "traced"},
        "kinks": [(1.0, 0.1), (2.0, 0.1)],
    }  # fmt: skip
    assert running._with_those_before({}, before) == before


@pytest.mark.parametrize("path", ["/dev/full/kept", "missing/kept"])
def test_a_solution_is_returned_although_its_checkpoint_cannot_be_written(tmp_path, path):
    problem = problems.load("pendulum")
    whole = integrate(problem, Gauss(s=2, h=0.1), [1.0, 2.0])
    found = integrate(problem, Gauss(s=2, h=0.1), [1.0, 2.0], checkpoint=tmp_path / path)
    assert found.status is Status.FINISHED
    assert np.array_equal(found.y, whole.y)
    [warning] = found.warnings
    assert "checkpoint" in warning
    assert "cannot be written" in warning
    assert "warning: " in str(found)


def test_a_full_disk_is_told_with_the_solution(tmp_path, monkeypatch):
    problem, path = problems.load("pendulum"), tmp_path / "kept"

    def full(handle, *_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("integrators.solution.files.os.fdopen", full)
    found = integrate(problem, Gauss(s=2, h=0.1), [1.0], checkpoint=path, every_seconds=0.0)
    assert found.status is Status.FINISHED
    assert "No space left on device" in found.warnings[0]
    assert not path.exists()


def test_a_warning_of_a_solution_is_saved_with_it(tmp_path):
    from integrators import load

    found = integrate(
        problems.load("pendulum"), Gauss(s=2, h=0.1), [1.0], checkpoint=tmp_path / "missing" / "kept"
    )
    found.save(tmp_path / "solution.npz")
    assert load(tmp_path / "solution.npz").warnings == found.warnings


def test_two_packages_that_offer_one_name_disable_that_name_only(monkeypatch):
    clash = [
        EntryPoint("Gauss", "elsewhere:Gauss", registry.GROUP),
        EntryPoint("New", "new:New", registry.GROUP),
    ]
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: clash)
    registry._entries.cache_clear()
    try:
        assert {"Gauss", "New", "HBVM"} <= set(registry.names())
        assert registry.get("HBVM") is HBVM
        with pytest.raises(InputError, match=r"two packages offer a method 'Gauss': .*elsewhere:Gauss"):
            registry.get("Gauss")
    finally:
        registry._entries.cache_clear()


class Emptied(list):
    """What another thread takes the last of, between a look and the grip."""

    def __bool__(self):
        return True


def test_two_threads_may_want_the_last_integrator():
    pytest.importorskip("heyoka")
    problem = problems.load("pendulum")
    program = Taylor(tol=1e-15).compile(problem.system)
    program._spare = {b"": Emptied()}
    found = []
    threads = [
        threading.Thread(target=lambda: found.append(program.start(problem.y0, problem.par, 0.0).t))
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [0.0] * 4
