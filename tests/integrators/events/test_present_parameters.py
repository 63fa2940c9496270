"""What follows an action has the parameters it has made: reductions, guards, files, earlier checkpoints."""

from typing import Any

import numpy as np
import pytest

import integrators
from integrators import HBVM, Event
from integrators.events.finder import EventLog
from integrators.reduce import Maximum, Mean
from problems import Hamiltonian, Problem
from problems.errors import InputError

integrate: Any = integrators.integrate
integrate_many: Any = integrators.integrate_many
SPRING = Hamiltonian(
    lambda q, p, par: p[0] ** 2 / 2 + par.k * q[0] ** 2 / 2,
    dof=1, parameters={"k": 1.0}, guards={"stiffness": lambda par: par.k - 1.0}, name="spring",
)  # fmt: skip
GRID = np.linspace(0.0, 9.0, 31)


def spring() -> Problem:
    return Problem(SPRING, y0=[1.0, 0.0], t_end=9.0)


def doubled(name: str = "passing") -> Event:
    return Event(lambda q: q[0], then=lambda q, p, par: ([q[0], p[0]], {"k": 2.0 * par.k}), name=name)


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_reductions_have_the_parameters_of_each_time(own: bool, sign: float) -> None:
    stiffness, times = [1.0, 1.5, 2.0], sign * GRID[1:]
    if own:
        times = np.stack([times, 0.9 * times, np.where(np.arange(30) < 20, times, np.nan)])
    given = {"parameters": {"k": stiffness}, "times": times, "events": doubled(), "threads": 2}
    plain = integrate_many(spring(), HBVM(), **given)
    most = Maximum(lambda q, p, par: p[0] ** 2 / 2 + par.k * q[0] ** 2 / 2, over="times")
    mean = Mean(lambda par: par.k, over="times")
    found = integrate_many(spring(), HBVM(), reduce={"most": most, "mean": mean}, **given)
    for i, k in enumerate(stiffness):
        alone = plain[i]
        passed = (sign * alone.events["passing"].t < sign * alone.t[:, np.newaxis]).sum(axis=1)
        assert passed[-1] > 2
        assert found.reduced["mean"][i] == pytest.approx(np.mean(k * 2.0**passed), rel=1e-14)  # measured 0
        energy = alone.invariants()["energy"].max()
        assert found.reduced["most"][i] == pytest.approx(energy, rel=1e-14)  # measured 2e-16


def test_guards_have_the_parameters_of_each_time() -> None:
    found = integrate(spring(), HBVM(), GRID, events=doubled())
    passed = (found.events["passing"].t < found.t[:, np.newaxis]).sum(axis=1)
    assert np.array_equal(found.guards()["stiffness"], 2.0**passed - 1.0)
    assert passed[-1] > 2


def _two(tmp_path: Any) -> tuple[Any, Any]:
    """Return an ensemble with two actions at each time, and what its file contains."""
    heavier = Event(lambda q: 2.0 * q[0], then=lambda q, p, par: ([q[0], p[0]], {"k": par.k + 1.0}), name="a")
    many = integrate_many(
        spring(), HBVM(), parameters={"k": [1.0, 1.5]}, times=GRID[1:], events=[doubled("z"), heavier]
    )
    many.save(tmp_path / "many.npz")
    return many, integrators.load(tmp_path / "many.npz")


def test_events_keep_their_order_in_a_file_of_an_ensemble(tmp_path: Any) -> None:
    many, loaded = _two(tmp_path)
    assert [*loaded.events[0]] == ["z", "a"]
    assert np.array_equal(many.events[0]["z"].t, many.events[0]["a"].t)
    for i in range(2):
        assert np.array_equal(loaded[i].invariants()["energy"], many[i].invariants()["energy"])


def test_an_ensemble_whose_file_knows_no_parameters_is_saved_again(tmp_path: Any) -> None:
    _two(tmp_path)
    with np.load(tmp_path / "many.npz") as file:
        arrays = {name: values for name, values in file.items() if not name.startswith("event_par:")}
    np.savez(tmp_path / "earlier.npz", **arrays)
    earlier: Any = integrators.load(tmp_path / "earlier.npz")
    earlier.save(tmp_path / "again.npz")
    again: Any = integrators.load(tmp_path / "again.npz")
    assert again.events[1]["z"].par is None
    assert np.array_equal(again.events[1]["z"].after, earlier.events[1]["z"].after)


def test_an_earlier_search_goes_on_unless_there_are_actions() -> None:
    events = {"zero": Event(lambda q: q[0])}
    log = EventLog(events, 1.0, 2, 1)
    state, none = np.array([[0.0, -1.0]]), np.zeros(1, dtype=np.int64)
    log.take(np.array([1.5]), state, state, none, none - 1)
    kept = log.save()
    kept["pieces"] = kept["pieces"][:5]
    again = EventLog(events, 1.0, 2, 1)
    again.load(kept)
    again.take(np.array([4.7]), -state, -state, none, none + 1)
    assert again.occurrences()["zero"].t.tolist() == [1.5, 4.7]
    acting = EventLog({"zero": doubled()}, 1.0, 2, 1)
    with pytest.raises(InputError, match="of another version"):
        acting.load(kept)
