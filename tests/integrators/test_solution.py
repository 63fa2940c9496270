"""A solution: states at any time, files, tables, pickles, what it prints."""

import doctest
import pickle
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import problems
from integrators import (
    DOP853,
    HBVM,
    Event,
    Gauss,
    Leapfrog,
    LineIntegral,
    Status,
    integrate,
    load,
)
from problems import Hamiltonian, InputError, Opaque, Poisson, Problem, VectorField, targets
from problems.errors import MissingLibraryError

METHODS = [
    HBVM(),
    HBVM(k=6, s=3, h=0.1),
    Gauss(s=4, tol=1e-12),
    LineIntegral(k=6, s=3, h=0.1, invariants=["energy"]),
    DOP853(rtol=1e-10, atol=1e-12),
    Leapfrog(h=0.05, order=8),
]


def _field(t, y):
    return [y[1], -y[0]]


def made(problem: Problem) -> dict[str, bytes]:
    """Return what another process makes of a problem."""
    solution = integrate(problem, HBVM(k=6, s=3, h=0.1), times=[0.0, 1.0])
    return {
        "field": targets.source(problem.system, "field", "numba").text.encode(),
        "y": solution.y.tobytes(),
        "errors": pickle.dumps({name: e.tolist() for name, e in problem.errors(solution.y).items()}),
        "print": repr(problem).encode(),
    }


def own(name: str) -> Problem:
    """Return a problem made of functions that no other process can import."""
    if name == "sums":
        system = Hamiltonian(
            lambda q, p, m, par: (
                m.sum(lambda i: p[i] ** 2 / 2, range(40))
                + par.k * m.sum(lambda i, j: (q[j] - q[i]) ** 4 / 4, [(i, (i + 1) % 40) for i in range(40)])
                - m.cos(q[0]) / 3
            ),
            dof=40, parameters={"k": 2.0}, invariants={"momentum": lambda p: sum(p)},
            domain=lambda q: 2 - q[0],
        )  # fmt: skip
        return Problem(system, q0=np.sin(np.arange(40.0)), p0=np.zeros(40), parameters={"k": 3.0}, t_end=5.0)
    if name == "poisson":
        system = Poisson(
            lambda y: y[0] ** 2 / 2 + y[1] ** 2 + 1.5 * y[2] ** 2,
            lambda y: [[0, -y[2], y[1]], [y[2], 0, -y[0]], [-y[1], y[0], 0]],
            dim=3, invariants={"casimir": lambda y: [y[0] ** 2 + y[1] ** 2 + y[2] ** 2]},
        )  # fmt: skip
        return Problem(system, y0=[1.0, 0.1, 0.2], t_end=5.0)
    system = VectorField(
        lambda t, y, m, par: [y[1], -y[0] + par.a[1] * m.sin(t)], dim=2, parameters={"a": [1, 2]}
    )
    return Problem(system, y0=[1.0, 0.0], t_end=5.0, times=[0.0, 2.5, 5.0])


class TestAtAnyTime:
    @pytest.mark.parametrize("method", METHODS, ids=repr)
    def test_it_has_the_methods_accuracy_between_samples(self, method, kepler, kepler_exact):
        solution = integrate(kepler(0.3), method, times=np.linspace(0.0, 6.0, 13))
        t = np.array([[0.1, 5.9], [3.33, 0.0]])
        exact = kepler_exact(0.3, t)
        # Measured, as at the samples: 2.6e-15, 2.4e-8, 9.4e-16, 2.4e-8, 1.1e-9, 9.9e-14.
        bound = max(4 * np.abs(solution.y - kepler_exact(0.3, solution.t)).max(), 1e-14)
        assert solution(t).shape == (2, 2, 4)
        assert np.abs(solution(t) - exact).max() < bound

    def test_energy_is_conserved_between_samples(self, henon_heiles):
        solution = integrate(henon_heiles, HBVM(k=6, s=4, h=0.25), times=np.linspace(0.0, 50.0, 6))
        between = solution(np.random.default_rng(1).uniform(0.0, 50.0, 40))
        # Measured 1.9e-16; the polynomial of the step leaves 2.4e-7.
        assert henon_heiles.errors(between)["energy"].max() < 2e-15

    def test_a_samples_own_time_is_that_sample(self, kepler):
        solution = integrate(kepler(0.3), HBVM(k=6, s=3, h=0.1), times=[1.0, 2.0, 3.0])
        assert np.array_equal(solution(solution.t[::-1]), solution.y[::-1])
        assert np.array_equal(solution(0.0), solution.problem.y0)

    def test_backwards(self, kepler, kepler_exact):
        solution = integrate(kepler(0.3), HBVM(), times=[0.0, -3.0, -6.0])
        # Measured 1.4e-15.
        assert np.abs(solution([-4.4, -0.2]) - kepler_exact(0.3, np.array([-4.4, -0.2]))).max() < 1e-14

    def test_up_to_a_terminal_event(self, kepler):
        event = Event(lambda q: q[0], terminal=True, name="axis")
        solution = integrate(kepler(0.3), HBVM(), times=[0.0, 0.5, 6.0], events=event)
        # Measured 4.2e-17.
        assert abs(solution(solution.t_stop)[0]) < 1e-15

    @pytest.mark.parametrize("t", [-0.1, 6.1, float("nan")])
    def test_other_times_are_refused(self, t, kepler):
        solution = integrate(kepler(0.3), HBVM(), times=[0.0, 6.0])
        with pytest.raises(InputError, match=r"is not between t = 0\.0 and 6\.0"):
            solution(t)

    def test_parts_of_the_state(self, kepler):
        solution = integrate(kepler(0.3), HBVM(), times=[0.0, 6.0])
        assert np.array_equal(np.hstack([solution.q, solution.p]), solution.y)
        free = integrate(own("field"), HBVM())
        assert free.q is None
        assert free.p is None


class TestFiles:
    @pytest.mark.parametrize("name", ["sums", "poisson", "field"])
    def test_bit_for_bit(self, name, tmp_path):
        solution = integrate(own(name), HBVM(tol=1e-10))
        solution.save(tmp_path / "solution.npz")
        again = load(tmp_path / "solution.npz")
        assert again.problem == solution.problem
        assert again.method == solution.method
        assert again.stats == solution.stats
        assert again.status is Status.FINISHED
        for value in ("t", "y"):
            assert np.array_equal(getattr(again, value), getattr(solution, value))
        assert str(again) == str(solution)
        assert np.array_equal(again(1.234), solution(1.234))
        assert {k: v.tobytes() for k, v in again.errors().items()} == {
            k: v.tobytes() for k, v in solution.errors().items()
        }

    def test_events_arrays_and_arguments(self, tmp_path):
        problem = problems.load("expression", H="p^2/2 - cos(q)", q0=(0.0,), p0=(1.9,), t_end=20.0)
        solution = integrate(problem, HBVM(), events=Event(lambda q: q[0], name="an event"))
        solution.stats.extra |= {"history": np.arange(6.0).reshape(2, 3), "pairs": [(1, 2.0)], "bad": np.nan}
        solution.save(tmp_path / "solution.npz")
        again = load(tmp_path / "solution.npz")
        assert again.problem == problem
        assert repr(again.problem) == repr(problem)
        assert np.array_equal(again.stats.extra["history"], solution.stats.extra["history"])
        assert again.stats.extra["pairs"] == [(1, 2.0)]
        assert np.isnan(again.stats.extra["bad"])
        for key in ("t", "y", "direction"):
            mine, other = (getattr(s.events["an event"], key) for s in (solution, again))
            assert np.array_equal(mine, other)
            assert mine.dtype == other.dtype

    def test_foreign_code_is_given_again(self, tmp_path):
        problem = Problem(Opaque(_field, dim=2), y0=[1.0, 0.0], t_end=1.0)
        integrate(problem, HBVM(k=4, s=2, h=0.1)).save(tmp_path / "a.npz")
        with pytest.raises(InputError, match="load it with problem="):
            load(tmp_path / "a.npz")
        assert load(tmp_path / "a.npz", problem=problem).problem is problem

    def test_a_damaged_file_is_told_in_one_sentence(self, kepler, tmp_path):
        path = tmp_path / "a.npz"
        integrate(kepler(0.3), HBVM()).save(path)
        whole = path.read_bytes()
        middle = bytearray(whole)
        middle[len(whole) // 2] ^= 1
        for damaged in (whole[:-100], whole[: len(whole) // 2], b"", b"text", bytes(middle)):
            path.write_bytes(damaged)
            with pytest.raises(InputError, match="is not a solution, or is damaged"):
                load(path)
        np.savez(path, t=np.zeros(3))
        with pytest.raises(InputError, match="is not a solution, or is damaged"):
            load(path)

    def test_no_file_and_no_folder(self, kepler, tmp_path):
        with pytest.raises(InputError, match="there is no file"):
            load(tmp_path / "none.npz")
        with pytest.raises(InputError, match="cannot be written"):
            integrate(kepler(0.3), HBVM()).save(tmp_path / "none" / "a.npz")

    def test_a_method_without_a_name_is_refused(self, kepler, tmp_path):
        class Mine(HBVM):
            pass

        with pytest.raises(InputError, match="Mine is not registered"):
            integrate(kepler(0.3), Mine()).save(tmp_path / "a.npz")


class TestPickles:
    @pytest.mark.parametrize("name", ["sums", "poisson", "field"])
    def test_own_problems_are_the_same_in_a_spawned_process(self, name):
        problem = own(name)
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            assert pool.submit(made, problem).result(timeout=120) == made(problem)

    @pytest.mark.parametrize("name", problems.names())
    def test_the_catalogue(self, name):
        problem = problems.load(name)
        again = pickle.loads(pickle.dumps(problem))
        assert again == problem
        assert repr(again) == repr(problem)
        assert not again.y0.flags.writeable
        for mine, its in zip(problem.system.functions, again.system.functions, strict=True):
            for backend in ("numba", "numpy"):
                assert targets.source(again.system, its, backend) == targets.source(
                    problem.system, mine, backend
                )

    def test_foreign_code_by_its_name(self):
        problem = Problem(Opaque(_field, dim=2, parameters={"a": 1.0}), y0=[1.0, 0.0], t_end=1.0)
        again = pickle.loads(pickle.dumps(problem))
        assert again == problem
        assert again.system.f is _field

    @pytest.mark.parametrize("method", [*METHODS, HBVM(k=6, s=3, tol=1e-8)], ids=repr)
    def test_programs_and_solutions(self, method, kepler):
        problem = kepler(0.3)
        assert pickle.loads(pickle.dumps(method)) == method
        program = pickle.loads(pickle.dumps(method.compile(problem.system)))
        solution = integrate(problem, method, times=[0.0, 1.0])
        assert np.array_equal(program.start(problem.y0).advance(np.array([0.0, 1.0])).y, solution.y)
        solution(0.5)
        again = pickle.loads(pickle.dumps(solution))
        assert np.array_equal(again.y, solution.y)
        assert np.array_equal(again(0.5), solution(0.5))


class TestPrinting:
    def test_the_essential(self, kepler):
        solution = integrate(kepler(0.3), HBVM(), events=Event(lambda q: q[1] - 0.1, name="line"))
        text = str(solution)
        for words in ("kepler", "HBVM(", "k=16, s=14", "steps of", "finished at t = 6.28", "evaluations"):
            assert words in text
        assert "largest errors: energy " in text
        assert "events found: line 2" in text
        assert len(repr(solution)) < 200

    def test_failures_and_warnings(self):
        blows_up = VectorField(lambda y: [y[0] ** 2], dim=1)
        text = str(integrate(Problem(blows_up, y0=[1.0], t_end=2.0), HBVM(k=4, s=2, h=0.1)))
        assert "nonlinear_divergence" in text or "not_finite" in text
        kinked = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + m.abs(q[0]), dof=1)
        assert "warning: " in str(integrate(Problem(kinked, q0=[1.0], p0=[0.0], t_end=5.0), HBVM()))

    def test_fixed_steps_choose_nothing(self, kepler):
        assert "on average" not in str(integrate(kepler(0.3), Leapfrog(h=0.1)))


class TestTables:
    def test_pandas(self, kepler):
        pytest.importorskip("pandas")
        frame = integrate(kepler(0.3), HBVM(), times=[0.0, 1.0]).to_pandas()
        assert list(frame.columns) == ["q0", "q1", "p0", "p1"]
        assert frame.index.name == "t"
        assert frame.attrs["method"] == "HBVM()"

    def test_xarray(self, kepler):
        pytest.importorskip("xarray")
        data = integrate(kepler(0.3), HBVM(), times=[0.0, 1.0]).to_xarray()
        assert data.q.dims == ("t", "i")
        assert data.p.sel(t=1.0).shape == (2,)

    @pytest.mark.parametrize("library", ["pandas", "xarray"])
    def test_a_missing_library_is_told_with_the_fix(self, library, kepler, monkeypatch):
        monkeypatch.setitem(sys.modules, library, None)
        solution = integrate(kepler(0.3), HBVM(), times=[0.0, 1.0])
        with pytest.raises(MissingLibraryError, match=f"pip install {library}"):
            getattr(solution, f"to_{library}")()


def test_the_examples_of_the_page_are_true():
    page = Path(__file__).parents[2] / "docs" / "solutions.md"
    result = doctest.testfile(str(page), module_relative=False, optionflags=doctest.ELLIPSIS)
    assert result.attempted >= 13
    assert result.failed == 0


@pytest.mark.parametrize("back", [1.0, -1.0])
def test_many_times_between_samples_take_few_starts(back, monkeypatch):
    # One for each interval before: 1e5 random times took 14 s, the run 0.3 s.
    problem = problems.load("kepler", e=0.6)
    times = back * np.linspace(0.0, 300.0, 2001)
    solution = integrate(problem, HBVM(), times)
    asked = back * np.random.default_rng(0).uniform(0.0, 300.0, 5000)
    asked[:3] = times[[0, 77, -1]]
    kind, starts = type(solution._interpolant.program), []
    start = kind.start

    def counted(self, *given):
        starts.append(given)
        return start(self, *given)

    monkeypatch.setattr(kind, "start", counted)
    found = solution(asked)
    assert len(starts) < 200  # measured 45, of 1834 intervals
    assert np.array_equal(found[:3], solution.y[[0, 77, -1]])
    order = np.argsort(back * asked)
    again = integrate(problem, HBVM(), asked[order])
    assert np.abs(found[order] - again.y).max() < 1e-12  # measured 2.5e-14
    assert problem.errors(found)["energy"].max() < 2e-14  # measured 3.3e-15
