"""What costs a newcomer time: names, ends, messages and prints."""

import sys
import warnings

import numpy as np
import pytest

import integrators
import problems
from integrators import HBVM, Progress, Status, Taylor, integrate


def _blow_up() -> problems.Problem:
    return problems.Problem(problems.VectorField(lambda y: [y[0] ** 2], dim=1), y0=[1.0], t_end=2.0)


def test_a_star_import_brings_every_method() -> None:
    names: dict[str, object] = {}
    before = {*sys.modules}
    exec("from integrators import *", names)  # noqa: S102 -- what a user types
    built_in = {name for own in integrators.registry.BUILT_IN.values() for name in own}
    assert built_in | {"advise", "integrate_many", "start"} <= {*names}
    assert not {"heyoka", "rebound", "diffrax", "jax"} & ({*sys.modules} - before)


def test_a_number_is_the_end() -> None:
    assert integrate(problems.load("kepler"), HBVM(), 10.0).t[-1] == 10.0


def test_a_system_is_no_problem() -> None:
    with pytest.raises(problems.InputError, match="a system without a start; give problems"):
        integrate(problems.Hamiltonian(lambda q, p: p[0] ** 2 / 2, dof=1), HBVM(), 10.0)  # pyright: ignore[reportArgumentType]


def test_a_failed_run_keeps_the_last_state() -> None:
    solution = integrate(_blow_up(), HBVM(), [2.0])
    assert solution.status is Status.STEP_UNDERFLOW
    assert solution.t.tolist() == [solution.t_stop]
    assert solution.y.shape == (1, 1)
    # y = 1/(1 - t); 1.0015, as t is rounded
    assert solution.y[0, 0] * (1.0 - solution.t_stop) == pytest.approx(1.0, rel=0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        str(solution)


def test_samples_before_a_failure_are_all_there_is() -> None:
    assert integrate(_blow_up(), HBVM(), [0.5, 2.0]).t.tolist() == [0.5]


@pytest.mark.parametrize("name", [None, "mine"])
def test_a_large_problem_prints_short(name: str | None) -> None:
    problem = problems.load("cluster", n=300)
    large = problems.Problem(problem.system, y0=problem.y0, t_end=1.0)
    if name is not None:
        large = large.with_metadata(
            name=name, title="", arguments={"y0": [0.1] * 900}, references=(), notes=""
        )
    assert len(large.written()) > 4000
    assert len(str(large)) < 420
    solution = integrate(large, HBVM(k=2, s=1, h=0.5), [0.5])
    assert len(repr(solution)) < 600
    if name is None:
        assert repr(large) == str(large)
    assert "in all]" in str(large)


def test_a_small_problem_prints_as_the_call_that_makes_it() -> None:
    assert str(problems.load("kepler")) == repr(problems.load("kepler"))
    assert str(_blow_up()) == repr(_blow_up())


def test_taylor_says_that_it_compiles_for_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("integrators.peers.heyoka.taylor.TaylorProgram._integrator", lambda *_, **__: None)
    nine, three = problems.load("cluster", n=9), problems.load("cluster", n=3)
    with pytest.warns(UserWarning, match=r"355 lines.* about 14 s .*compact_mode=True"):
        Taylor().compile(nine.system)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Taylor(compact_mode=True).compile(nine.system)
        Taylor().compile(three.system)


def test_progress_prints_as_a_sentence_when_nothing_is_known_of_the_rest() -> None:
    assert str(Progress(0.0, 0.0, 0, 0.01, np.inf)) == "t = 0, 0%, 0 steps, 0.01 s, time left unknown"
    assert str(Progress(5.0, 0.25, 1024, 3.0, 9.0)) == "t = 5, 25%, 1,024 steps, 3 s, 9 s left"
