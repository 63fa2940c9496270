"""What an ensemble offers besides its states: members, times of their own, files, reductions, executors."""

import os
import signal
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import integrators
import problems
from integrators import HBVM, Event, Gauss, Solution, Solutions, Status, integrate, integrate_many, load
from integrators.reduce import Histogram, Maximum, Mean, Minimum
from integrators.running import pieces
from problems import InputError, Problem

GAUSS = Gauss(s=4, h=0.1)
N = 20
STARTS = np.column_stack([np.zeros(N), np.linspace(0.1, 1.9, N)])
TIMES = [0.5, 1.25, 4.0]


@pytest.fixture(scope="module")
def pendulum() -> Problem:
    return problems.load("pendulum")


@pytest.fixture(scope="module")
def made(pendulum: Problem) -> Solutions:
    return integrate_many(pendulum, GAUSS, starts=STARTS, times=TIMES)


def _same(one: Solutions, other: Solutions) -> None:
    for name in ("t", "y", "t_stop", "steps", "starts", "par"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name
    assert one.status == other.status


def test_a_member_is_a_solution(pendulum: Problem, made: Solutions) -> None:
    one = made[7]
    alone = integrate(Problem(pendulum.system, y0=STARTS[7], t_end=4.0), GAUSS, TIMES)
    assert isinstance(one, Solution)
    assert np.abs(one.y - alone.y).max() <= 1e-14  # other order of sums: measured 4e-16
    assert np.array_equal(one.t, alone.t)
    assert one.stats.steps == alone.stats.steps
    assert np.abs(one(2.0) - alone(2.0)).max() <= 1e-14
    assert np.array_equal(made.errors()["energy"][7], one.errors()["energy"])
    assert made[-1].problem.y0.tolist() == STARTS[-1].tolist()
    assert len(list(made)) == N
    with pytest.raises(IndexError):
        made[N]


def test_some_of_them(made: Solutions) -> None:
    assert np.array_equal(made[3:6].y, made.y[3:6])
    assert np.array_equal(made[made.starts[:, 1] > 1.0].starts, STARTS[STARTS[:, 1] > 1.0])
    assert made.q is not None
    assert made.p is not None
    assert np.array_equal(np.concatenate([made.q, made.p], axis=2), made.y)


@pytest.mark.parametrize("method", [GAUSS, HBVM(), integrators.DOP853(rtol=1e-10, atol=1e-10)], ids=repr)
@pytest.mark.parametrize("threads", [1, 2])
def test_times_of_their_own(pendulum: Problem, method: Any, threads: int) -> None:
    periods = np.linspace(1.0, 9.0, N)
    times = periods[:, None] * [0.5, 1.0, 1.5]
    times[3, 2] = np.nan
    found = integrate_many(pendulum, method, starts=STARTS, times=times, threads=threads)
    assert np.array_equal(found.t, times, equal_nan=True)
    for i in (0, 3, N - 1):
        row = times[i][~np.isnan(times[i])]
        alone = integrate(Problem(pendulum.system, y0=STARTS[i], t_end=row[-1]), method, row)
        assert np.array_equal(found[i].y, alone.y)
        assert np.array_equal(found[i].t, row)
    assert np.isnan(found.y[3, 2]).all()
    assert found.arrived.all()
    assert not any(found.warnings)


@pytest.mark.parametrize("backwards", [False, True])
def test_samples_of_adaptive_steps(pendulum: Problem, backwards: bool) -> None:
    end = -6.0 if backwards else 6.0
    found = integrate_many(pendulum, HBVM(), starts=STARTS, times=[end], sample="steps")
    for i in (0, 11, N - 1):
        alone = integrate(Problem(pendulum.system, y0=STARTS[i], t_end=end), HBVM(), [end], sample="steps")
        assert np.array_equal(found[i].t, alone.t)
        assert np.array_equal(found[i].y, alone.y)
    assert len({one.t.size for one in found}) > 1


def test_events_of_trajectories_with_times_of_their_own(pendulum: Problem) -> None:
    times = np.linspace(5.0, 30.0, N)[:, None]
    up = Event(lambda q: q[0], direction=1, name="up")
    found = integrate_many(pendulum, GAUSS, starts=STARTS, times=times, events=up)
    for i in (0, N - 1):
        alone = integrate(Problem(pendulum.system, y0=STARTS[i], t_end=50.0), GAUSS, times[i], events=up)
        assert np.array_equal(found[i].events["up"].t, alone.events["up"].t)


@pytest.mark.parametrize("how", ["times", "steps", "events", "reduce", "failed"])
def test_it_comes_back_from_a_file(pendulum: Problem, tmp_path: Path, how: str) -> None:
    more: dict[str, Any] = {
        "times": {"times": TIMES},
        "steps": {"times": [3.0], "sample": "steps"},
        "events": {"times": TIMES, "events": [Event(lambda q: q[0], name="a"), Event(lambda p: p[0])]},
        "reduce": {"times": TIMES, "reduce": {"mean": Mean(lambda q: q[0] ** 2)}},
        "failed": {"times": TIMES},
    }[how]  # fmt: skip
    method = HBVM(tol=1e-12, max_steps=3) if how == "failed" else HBVM(tol=1e-12)
    found = integrate_many(pendulum, method, starts=STARTS, **more)
    found.save(tmp_path / "many.npz")
    again = load(tmp_path / "many.npz")
    _same(found, again)
    assert (again.reason, again.extra, again.problem, again.method) == (
        found.reason, found.extra, found.problem, found.method,
    )  # fmt: skip
    assert again.warnings == found.warnings
    assert {k: v.tolist() for k, v in again.reduced.items()} == {
        k: v.tolist() for k, v in found.reduced.items()
    }
    for one, other in zip(again.events, found.events, strict=True):
        assert {k: vars(v)["t"].tolist() for k, v in one.items()} == {
            k: v.t.tolist() for k, v in other.items()
        }
    assert str(again).splitlines()[:3] == str(found).splitlines()[:3]


def test_a_changed_file_is_refused(made: Solutions, tmp_path: Path) -> None:
    path = tmp_path / "many.npz"
    made.save(path)
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    shapes = {"steps": (3,), "y": (N, 3, 5), "t": (9,), "par": (1, 1), "starts": (N, 1), "words": (0,)}
    for name, shape in shapes.items():
        np.savez(path, **{**arrays, name: np.zeros(shape)})
        with pytest.raises(InputError, match="damaged"):
            load(path)


def test_print_is_a_summary(pendulum: Problem, made: Solutions) -> None:
    text = str(made)
    assert len(text.splitlines()) == 5
    assert "20 trajectories to t = 4, 3 states of each: 20 finished" in text
    assert "800 steps (40 to 40, half of them up to 40)" in text
    failed = integrate_many(pendulum, HBVM(max_steps=5), starts=STARTS, times=[50.0])
    assert "the first that failed, number 0, at t = " in str(failed)
    assert len(repr(failed)) < 200


def test_tables(made: Solutions) -> None:
    pandas = pytest.importorskip("pandas")
    frame = made.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame.loc[(3, 1.25)].tolist() == made.y[3, 1].tolist()


def test_xarray_has_values_coordinates_and_attributes(pendulum: Problem, made: Solutions) -> None:
    xarray = pytest.importorskip("xarray")
    data = made.to_xarray()
    assert isinstance(data, xarray.Dataset)
    assert set(data.data_vars) == {"q", "p", "status"}
    assert dict(data.sizes) == {"trajectory": N, "time": 3, "i": 1}
    for name, values in (("q", made.q), ("p", made.p)):
        assert data[name].dims == ("trajectory", "time", "i")
        assert np.array_equal(data[name].values, values)
    assert data.status.dims == ("trajectory",)
    assert data.status.values.tolist() == ["finished"] * N
    assert set(data.coords) == {"t"}
    assert (data.t.dims, data.t.values.tolist()) == (("time",), TIMES)
    assert data.attrs == {"problem": repr(pendulum), "method": repr(GAUSS)}
    assert data.swap_dims(time="t").q.sel(t=1.25, trajectory=3).values.tolist() == made.y[3, 1, :1].tolist()


def test_xarray_of_times_of_their_own_and_of_first_order(pendulum: Problem) -> None:
    pytest.importorskip("xarray")
    times = [[0.5, 1.0], [2.0, np.nan]]
    data = integrate_many(pendulum, GAUSS, starts=STARTS[:2], times=times).to_xarray()
    assert data.t.dims == ("trajectory", "time")
    assert np.array_equal(data.t.values, times, equal_nan=True)
    assert np.isnan(data.q.values[1, 1]).all()
    decay = Problem(problems.VectorField(lambda y: [-y[0]], dim=1), y0=[1.0], t_end=1.0)
    first_order = integrate_many(decay, GAUSS, starts=[[1.0], [2.0]], times=[0.5]).to_xarray()
    assert set(first_order.data_vars) == {"y", "status"}
    # order 8 with h = 0.1: measured 2.2e-16
    assert np.abs(first_order.y.values[:, 0, 0] - np.exp(-0.5) * np.array([1.0, 2.0])).max() <= 1e-15


REDUCTIONS = {
    "mean": Mean(lambda q, par: q[0] ** 2),
    "least": Minimum(lambda p: p[0]),
    "most": Maximum(lambda t, p: t * p[0]),
    "counts": Histogram(lambda q: q[0], edges=np.linspace(-2.0, 2.0, 9).tolist()),
    "own mean": Mean(lambda q: q[0] ** 2, over="times"),
    "own least": Minimum(lambda p: p[0], over="times"),
    "own counts": Histogram(lambda q: q[0], edges=[-1.0, 0.0, 1.0], over="times"),
}


@pytest.mark.parametrize("piece", [None, 1, 7])
def test_reductions_are_those_of_all_states(pendulum: Problem, made: Solutions, piece: int | None) -> None:
    found = integrate_many(pendulum, GAUSS, starts=STARTS, times=TIMES, reduce=REDUCTIONS, piece=piece)
    q, p = made.y[:, :, 0], made.y[:, :, 1]
    wanted = {
        "mean": (q**2).mean(axis=0),
        "least": p.min(axis=0),
        "most": (p * TIMES).max(axis=0),
        "counts": np.array([np.histogram(x, np.linspace(-2.0, 2.0, 9))[0] for x in q.T]),
        "own mean": (q**2).mean(axis=1),
        "own least": p.min(axis=1),
        "own counts": np.array([np.histogram(x, [-1.0, 0.0, 1.0])[0] for x in q]),
    }
    for name, values in wanted.items():
        assert found.reduced[name] == pytest.approx(values, rel=1e-14), name  # means: another order of sums
    assert np.array_equal(found.y, made.y[:, -1:])
    assert np.array_equal(found.t, made.t[-1:])


def test_what_did_not_arrive_does_not_count() -> None:
    blow_up = Problem(problems.VectorField(lambda y: [y[0] ** 2], dim=1), y0=[1.0], t_end=2.0)
    found = integrate_many(
        blow_up, HBVM(), starts=[[0.1], [1.0], [2.0]], times=[0.25, 0.75, 2.0],
        reduce={"mean": Mean(lambda y: y[0]), "own": Minimum(lambda y: y[0], over="times")},
    )  # fmt: skip
    assert found.reduced["mean"] == pytest.approx(
        [(1 / 9.75 + 1 / 0.75 + 1 / 0.25) / 3, (1 / 9.25 + 4) / 2, 1 / 8]
    )
    assert found.reduced["own"] == pytest.approx([1 / 9.75, 1 / 0.75, 4.0])


class _Dies(Executor):
    """Runs what it is given, but the pieces of some calls, as if their workers had died."""

    def __init__(self, dead: set[int]):
        self.dead, self.calls, self.sizes = dead, 0, list[int]()

    def submit(self, fn: Any, /, *args: Any, **more: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.calls += 1
        self.sizes.append(len(args[2][0]))
        if self.calls - 1 in self.dead:
            future.set_exception(OSError("killed"))
        else:
            future.set_result(fn(*args, **more))
        return future


def test_an_executor_gives_the_same(pendulum: Problem, made: Solutions) -> None:
    with ThreadPoolExecutor(2) as pool:
        found = integrate_many(pendulum, GAUSS, starts=STARTS, times=TIMES, executor=pool, piece=6)
        _same(found, made)
        own = np.linspace(1.0, 2.0, N)[:, None]
        _same(
            integrate_many(pendulum, GAUSS, starts=STARTS, times=own, executor=pool),
            integrate_many(pendulum, GAUSS, starts=STARTS, times=own),
        )


def test_a_piece_whose_worker_dies_is_sent_again(pendulum: Problem, made: Solutions) -> None:
    executor = _Dies({1})  # the second of four pieces, once
    found = integrate_many(pendulum, GAUSS, starts=STARTS, times=TIMES, executor=executor, piece=5)
    _same(found, made)
    assert executor.calls == 5


@pytest.mark.parametrize("reduce", [{}, REDUCTIONS], ids=["states", "reductions"])
def test_what_is_lost_is_told_and_can_be_resumed(
    pendulum: Problem, made: Solutions, tmp_path: Path, reduce: Any
) -> None:
    path = tmp_path / "many.checkpoint"
    executor = _Dies({1, 4})  # the second piece, and the same when it is sent again
    ensemble: Any = {"starts": STARTS, "times": TIMES, "piece": 5, "reduce": reduce}
    part = integrate_many(pendulum, GAUSS, **ensemble, executor=executor, checkpoint=path)
    assert [i for i, status in enumerate(part.status) if status is Status.INTERRUPTED] == [5, 6, 7, 8, 9]
    assert (
        part.reason[5] == "its worker ended (OSError: killed); resume it from a checkpoint, or run it again."
    )
    healthy = _Dies(set())
    rest = integrate_many(pendulum, GAUSS, **ensemble, executor=healthy, resume=path)
    assert healthy.sizes == [5]  # the rest was kept
    assert rest.arrived.all()
    whole = integrate_many(pendulum, GAUSS, **ensemble)
    _same(rest, whole)
    for name, values in whole.reduced.items():
        assert rest.reduced[name] == pytest.approx(values, rel=1e-14), name
    with pytest.raises(InputError, match="with other start than here"):
        integrate_many(pendulum, GAUSS, **{**ensemble, "starts": STARTS + 1}, resume=path)


def test_ctrl_c_and_going_on_locally(pendulum: Problem, made: Solutions, tmp_path: Path) -> None:
    path = tmp_path / "many.checkpoint"

    def interrupt(progress: integrators.Progress) -> None:
        if progress.fraction > 0.3:
            raise KeyboardInterrupt

    ensemble: Any = {"starts": STARTS, "times": TIMES, "piece": 4}
    part = integrate_many(pendulum, GAUSS, **ensemble, progress=interrupt, checkpoint=path)
    assert 0 < part.arrived.sum() < N
    _same(integrate_many(pendulum, GAUSS, **ensemble, resume=path), made)


def _kill_once(flag: str, *task: Any) -> Any:
    """Do a task in a worker, which is killed at its first one."""
    path = Path(flag)
    if not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return pieces.integrate_piece(*task)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a signal that kills")
def test_a_pool_that_breaks_keeps_what_was_done(pendulum: Problem, made: Solutions, tmp_path: Path) -> None:
    from functools import partial
    from unittest.mock import patch

    path, flag = tmp_path / "many.checkpoint", str(tmp_path / "killed")
    ensemble: Any = {"starts": STARTS, "times": TIMES, "piece": 5}
    with (
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool,
        patch("integrators.running.many.integrate_piece", partial(_kill_once, flag)),
    ):
        part = integrate_many(pendulum, GAUSS, **ensemble, executor=pool, checkpoint=path)
    assert not part.arrived.any()
    assert "BrokenProcessPool" in part.reason[0]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        _same(integrate_many(pendulum, GAUSS, **ensemble, executor=pool, resume=path), made)


@pytest.mark.slow
def test_dask_gives_the_same(pendulum: Problem, made: Solutions) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.Client(
        processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None
    ) as client:
        _same(
            integrate_many(
                pendulum, GAUSS, starts=STARTS, times=TIMES, executor=client.get_executor(), piece=5
            ),
            made,
        )


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"times": [[1.0]] * 3}, "those of 3 trajectories, not of 20"),
        ({"times": [[np.nan, 1.0]] * N}, "with NaN at its end only"),
        ({"executor": 3}, "executor=3 is none"),
        ({"reduce": {"x": np.mean}}, "is no reduction"),
        (
            {"reduce": {"x": Mean(lambda q: q[0])}, "sample": "steps"},
            "give it over='times', or leave out sample=",
        ),
        ({"executor": ThreadPoolExecutor(1), "events": lambda q: q[0]}, "functions of a module"),
        ({"events": lambda q: q[0], "sample": "steps"}, "sample= and events= do not go together"),
        ({"piece": 0}, "at least 1"),
        ({"resume": "nowhere"}, "no checkpoint"),
    ],
)
def test_what_cannot_be_asked_for(pendulum: Problem, more: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        integrate_many(pendulum, GAUSS, **{"starts": STARTS, "times": [1.0], **more})


@pytest.mark.parametrize("edges", [[1.0], [2.0, 1.0], "ab", [0.0, np.nan]])
def test_edges_that_are_none(edges: Any) -> None:
    with pytest.raises(InputError, match="at least two increasing numbers"):
        Histogram(lambda q: q[0], edges=edges)
