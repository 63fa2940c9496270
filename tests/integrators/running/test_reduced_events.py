"""Ensembles that are reduced, or sent to workers, with times of their own, steps and events."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import problems
from integrators import Event, Gauss, Solutions, Status, integrate_many
from integrators.reduce import Maximum, Mean, Minimum

PENDULUM = problems.load("pendulum")
METHOD = Gauss(s=3, h=0.1)
STARTS = np.column_stack([np.zeros(7), np.linspace(0.1, 1.5, 7)])
OWN = np.array([[1.0, 2.0, 3.0]] * 3 + [[0.5, 1.5, np.nan]] * 4)
MEAN, LEAST = Mean(lambda q: q[0] ** 2), Minimum(lambda q: q[0], over="times")


def turning(p: Any) -> Any:
    """Vanish where a pendulum turns."""
    return p[0]


TURN = Event(turning, terminal=True, name="turn")


@pytest.mark.parametrize("piece", [None, 1, 4])
def test_times_of_their_own_are_reduced(piece: int | None) -> None:
    plain = integrate_many(PENDULUM, METHOD, starts=STARTS, times=OWN)
    found = integrate_many(
        PENDULUM, METHOD, starts=STARTS, times=OWN, piece=piece, reduce={"mean": MEAN, "least": LEAST}
    )
    assert found.reduced["mean"] == pytest.approx(np.nanmean(plain.y[:, :, 0] ** 2, axis=0), rel=1e-14)
    assert np.array_equal(found.reduced["least"], np.nanmin(plain.y[:, :, 0], axis=1))
    assert found.t.tolist() == [[3.0]] * 3 + [[1.5]] * 4
    assert np.array_equal(found.y[:3, 0], plain.y[:3, 2])
    assert np.array_equal(found.y[3:, 0], plain.y[3:, 1])
    assert found[5].t.tolist() == [1.5]


@pytest.mark.parametrize("piece", [None, 2])
def test_steps_are_reduced_over_the_times_of_each(piece: int | None) -> None:
    own = [[t] for t in np.linspace(1.0, 2.0, 7)]
    plain = integrate_many(PENDULUM, METHOD, starts=STARTS, times=own, sample="steps")
    most = Maximum(lambda t, p: t * p[0], over="times")
    found = integrate_many(
        PENDULUM,
        METHOD,
        starts=STARTS,
        times=own,
        sample="steps",
        piece=piece,
        reduce={"most": most, "least": LEAST},
    )
    assert np.array_equal(found.reduced["least"], np.nanmin(plain.y[:, :, 0], axis=1))
    assert np.array_equal(found.reduced["most"], np.nanmax(plain.t * plain.y[:, :, 1], axis=1))
    assert np.array_equal(found.t[:, 0], np.nanmax(plain.t, axis=1))
    assert [solution.y[-1].tolist() for solution in plain] == found.y[:, 0].tolist()


def test_samples_until_a_terminal_event_are_reduced() -> None:
    times = np.linspace(0.1, 5.0, 50)
    plain = integrate_many(PENDULUM, METHOD, starts=STARTS, times=times, events=TURN)
    found = integrate_many(
        PENDULUM, METHOD, starts=STARTS, times=times, events=TURN, reduce={"mean": MEAN, "least": LEAST}
    )
    assert {*found.status} == {Status.EVENT}
    assert np.isnan(plain.y[:, -1]).all()
    with np.errstate(invalid="ignore"):
        there = ~np.isnan(plain.y[:, :, 0])
        wanted = np.where(there, plain.y[:, :, 0] ** 2, 0.0).sum(axis=0) / there.sum(axis=0)
    assert found.reduced["mean"] == pytest.approx(wanted, rel=1e-14, nan_ok=True)
    assert np.array_equal(found.reduced["least"], np.nanmin(plain.y[:, :, 0], axis=1))
    assert [hits["turn"].t.tolist() for hits in found.events] == [[t] for t in found.t_stop]


def test_a_reduction_of_own_times_goes_on_from_a_checkpoint(tmp_path: Path) -> None:
    def stop(progress: Any) -> None:
        if progress.fraction > 0.2:
            raise KeyboardInterrupt

    file, given = tmp_path / "kept", {"starts": STARTS, "times": OWN, "reduce": {"mean": MEAN}, "piece": 2}
    broken = integrate_many(PENDULUM, METHOD, **given, checkpoint=file, progress=stop)
    assert Status.INTERRUPTED in broken.status
    whole, resumed = (
        integrate_many(PENDULUM, METHOD, **given, **more)
        for more in ({}, {"resume": file, "checkpoint": file})
    )
    assert np.array_equal(resumed.reduced["mean"], whole.reduced["mean"])
    assert np.array_equal(resumed.t, whole.t)
    assert np.array_equal(resumed.y, whole.y)


def _same(one: Solutions, other: Solutions) -> None:
    assert np.array_equal(one.y, other.y, equal_nan=True)
    assert (one.status, one.reason) == (other.status, other.reason)
    for happened, wanted in zip(one.events, other.events, strict=True):
        assert {*happened} == {*wanted} == {"turn"}
        assert happened["turn"].t.tolist() == wanted["turn"].t.tolist()
        assert happened["turn"].y.tolist() == wanted["turn"].y.tolist()


@pytest.mark.parametrize("times", [[1.0, 5.0], OWN], ids=["same", "own"])
def test_workers_find_events(times: Any) -> None:
    alone = integrate_many(PENDULUM, METHOD, starts=STARTS, times=times, events=TURN)
    with ThreadPoolExecutor(2) as pool:
        _same(
            integrate_many(PENDULUM, METHOD, starts=STARTS, times=times, events=TURN, executor=pool, piece=3),
            alone,
        )
    assert any(len(happened["turn"]) for happened in alone.events)


def test_processes_find_events() -> None:
    alone = integrate_many(PENDULUM, METHOD, starts=STARTS, times=[5.0], events=TURN)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        made = integrate_many(
            PENDULUM, METHOD, starts=STARTS, times=[5.0], events=TURN, executor=pool, piece=4
        )
    _same(made, alone)
