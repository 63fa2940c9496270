"""The functions of m: values and derivatives in every engine, against NumPy, SciPy and mpmath."""

import doctest
import math
import pickle
import re
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, RectBivariateSpline, interp1d
from scipy.special import erf, erfc

import problems
from integrators import DOP853, HBVM, Gauss, Taylor, integrate, integrate_many
from problems import Hamiltonian, InputError, Problem, VectorField, targets
from problems.analysis import structure
from problems.analysis.switches import Switches
from problems.double_double import DD
from problems.evaluate.pairs import evaluate
from problems.graph.arguments import OTHERS
from problems.graph.functions import FUNCTIONS
from problems.targets import latex

KNOTS = [-2.0, -1.1, -0.3, 0.5, 1.0, 2.0]
POINTS = [0.3, -1.0, 0.7, 0.1, 0.9, -0.4]
SPLINE = CubicSpline(KNOTS, POINTS)

# What a user writes, and what NumPy makes of it; smooth between -0.95 and 0.95, but for the last seven.
FORMULAS = {
    "tanh": (lambda x, y, m: m.tanh(3 * x) * y, lambda x, y: np.tanh(3 * x) * y),
    "sinh": (lambda x, y, m: m.sinh(x + y), lambda x, y: np.sinh(x + y)),
    "cosh": (lambda x, y, m: m.cosh(x * y), lambda x, y: np.cosh(x * y)),
    "asin": (lambda x, y, m: m.asin(x) / (2 + y), lambda x, y: np.arcsin(x) / (2 + y)),
    "acos": (lambda x, y, m: m.acos(x * y), lambda x, y: np.arccos(x * y)),
    "atan": (lambda x, y, m: m.atan(5 * x - y), lambda x, y: np.arctan(5 * x - y)),
    "atan2": (lambda x, y, m: m.atan2(y + 2, x), lambda x, y: np.arctan2(y + 2, x)),
    "erf": (lambda x, y, m: m.erf(2 * x) + y * y, lambda x, y: erf(2 * x) + y * y),
    "erfc": (lambda x, y, m: m.erfc(2 * x) * y, lambda x, y: erfc(2 * x) * y),
    "asinh": (lambda x, y, m: m.asinh(3 * x) * y, lambda x, y: np.arcsinh(3 * x) * y),
    "acosh": (lambda x, y, m: m.acosh(2 + x) + y * y, lambda x, y: np.arccosh(2 + x) + y * y),
    "atanh": (lambda x, y, m: m.atanh(x / 2) * y, lambda x, y: np.arctanh(x / 2) * y),
    "expm1": (lambda x, y, m: m.expm1(x * y), lambda x, y: np.expm1(x * y)),
    "log1p": (lambda x, y, m: m.log1p(x / 2) * y, lambda x, y: np.log1p(x / 2) * y),
    "hypot": (lambda x, y, m: m.hypot(x - 2, y), lambda x, y: np.hypot(x - 2, y)),
    "table": (lambda x, y, m: m.table(x + y, KNOTS, POINTS), lambda x, y: SPLINE(x + y)),
    "where": (
        lambda x, y, m: m.where((x > y) & ~(x > 0.5), x**3, m.exp(y)),
        lambda x, y: np.where((x > y) & (x <= 0.5), x**3, np.exp(y)),
    ),
    "either": (
        lambda x, y, m: m.where((x <= y) | (x >= 0.5), m.sin(x), x * y),
        lambda x, y: np.where((x <= y) | (x >= 0.5), np.sin(x), x * y),
    ),
    "round": (
        lambda x, y, m: (4 * x - m.round(4 * x)) ** 2 * y,
        lambda x, y: (4 * x - np.rint(4 * x)) ** 2 * y,
    ),
    "floor": (
        lambda x, y, m: (4 * x - m.floor(4 * x) - 0.5) ** 2 * y,
        lambda x, y: (4 * x - np.floor(4 * x) - 0.5) ** 2 * y,
    ),
    "sign": (lambda x, y, m: m.sign(x - y) * (x - y) ** 2, lambda x, y: np.sign(x - y) * (x - y) ** 2),
    "min": (
        lambda x, y, m: m.min(x, y, 0.3) ** 2 + x * y,
        lambda x, y: np.minimum(np.minimum(x, y), 0.3) ** 2 + x * y,
    ),
    "max": (lambda x, y, m: m.max(x, y) ** 2, lambda x, y: np.maximum(x, y) ** 2),
}  # fmt: skip


def system_of(name):
    formula = FORMULAS[name][0]
    return Hamiltonian(
        lambda q, p, m: p[0] ** 2 / 2 + p[1] ** 2 / 2 + formula(q[0], q[1], m), dof=2, name=name
    )


def states(n=40):
    """Return states (4, n), none of them where a formula has a kink."""
    return np.random.default_rng(7).uniform(-0.95, 0.95, (4, n))


@pytest.mark.parametrize("name", FORMULAS)
class TestEveryEngine:
    def test_values(self, name):
        y = states()
        wanted = (y[2] ** 2 + y[3] ** 2) / 2 + FORMULAS[name][1](y[0], y[1])
        found = targets.numpy(system_of(name), "hamiltonian")(0.0, y, np.empty(0))[0]
        # Measured 6.7e-16.
        assert np.abs(found - wanted).max() < 2e-15

    def test_gradients_against_differences(self, name):
        y, h = states(), 1e-4
        field = targets.numpy(system_of(name), "field")(0.0, y, np.empty(0))
        for i in range(2):
            ends = []
            for far in (-2, -1, 1, 2):
                moved = y.copy()
                moved[i] += far * h
                ends.append(FORMULAS[name][1](moved[0], moved[1]))
            slope = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
            near = np.abs(y[0] - y[1]) < 3 * h
            # Measured 4.3e-12; a table, whose third derivative jumps, 6.6e-12.
            assert np.abs(field[2 + i] + slope)[~near].max() < 3e-11

    def test_jacobians_against_differences(self, name):
        system, h = system_of(name), 1e-4
        jacobian = system.jacobian("force")
        y = states(1)[:, 0]
        full = np.zeros((2, 2))
        full[jacobian.rows, jacobian.columns] = targets.numpy(system, jacobian)(0.0, y, np.empty(0))
        force = targets.numpy(system, "force")
        for i in range(2):
            e = h * np.eye(4)[i]
            at = [force(0.0, y + k * e, np.empty(0)) for k in (-2, -1, 1, 2)]
            # Measured 1.0e-11.
            assert np.abs(full[:, i] - (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * h)).max() < 5e-11

    def test_the_engines_agree(self, name):
        system = system_of(name)
        y = states(20)
        wanted = targets.numpy(system, "field")(0.0, y, np.empty(0))
        size = np.abs(wanted).max()
        found = np.empty_like(wanted)
        compiled, jax = targets.numba(system, "field"), targets.jax(system, "field")
        for i in range(y.shape[1]):
            out = np.empty(4)
            compiled(0.0, y[:, i].copy(), np.empty(0), out)
            found[:, i] = out
            # Measured 3.8e-16.
            assert np.abs(np.asarray(jax(0.0, y[:, i], np.empty(0))) - wanted[:, i]).max() < 2e-15 * size
        # Measured 3.3e-16.
        assert np.abs(found - wanted).max() < 2e-15 * size

    def test_heyoka(self, name):
        hy = pytest.importorskip("heyoka")
        if name == "table" or (name in FUNCTIONS and FUNCTIONS[name].heyoka is None):
            with pytest.raises(InputError, match=rf"m\.{name}"):
                targets.heyoka(system_of(name))
            return
        pairs = targets.heyoka(system_of(name))
        variables, slopes = zip(*pairs, strict=True)
        y = states(20)
        found = hy.cfunc(list(slopes), vars=list(variables))(np.ascontiguousarray(y))
        wanted = targets.numpy(system_of(name), "field")(0.0, y, np.empty(0))
        # Measured 2.8e-16.
        assert np.abs(found - wanted).max() < 2e-15 * np.abs(wanted).max()

    def test_in_a_declared_sum(self, name):
        formula, plain = FORMULAS[name]
        system = Hamiltonian(lambda q, m: m.sum(lambda i: formula(q[i], q[i + 1], m), range(200)), dof=201)
        y = np.random.default_rng(3).uniform(-0.95, 0.95, 402)
        assert targets.numpy(system, "hamiltonian")(0.0, y, np.empty(0))[0] == pytest.approx(
            plain(y[:200], y[1:201]).sum(), rel=1e-13
        )
        out, wanted = np.empty(402), targets.numpy(system, "field")(0.0, y, np.empty(0))
        targets.numba(system, "field")(0.0, y, np.empty(0), out)
        assert np.abs(out - wanted).max() < 1e-14 * np.abs(wanted).max()

    def test_a_trajectory_keeps_its_energy(self, name):
        problem = Problem(system_of(name), q0=[0.3, 0.2], p0=[0.05, -0.03], t_end=1.0)
        solution = integrate(problem, HBVM(), times=np.linspace(0.0, 1.0, 21))
        # Measured 6.6e-16; a table's pieces in space are not landed on, 4.5e-12.
        assert solution.errors()["energy"].max() < (2e-11 if name == "table" else 3e-15)
        other = integrate(problem, DOP853(rtol=1e-11, atol=1e-13), times=solution.t)
        # Measured 3.1e-9 with the table.
        assert np.abs(solution.y - other.y).max() < 1e-8

    def test_pickle_and_formula(self, name):
        system = system_of(name)
        again = pickle.loads(pickle.dumps(system))
        assert targets.source(again, "field", "numba") == targets.source(system, "field", "numba")
        assert latex.latex(system)


def field_of(ones):
    """Return functions as one field, x' = [f(x_0), g(x_1), ...], with states in their domains."""
    system = VectorField(
        lambda y, m: [getattr(m, f.name)(x) for f, x in zip(ones, y, strict=True)], dim=len(ones)
    )
    low, high = np.clip([f.domain for f in ones], -3.0, 3.0).T
    inside = np.random.default_rng(2).uniform(0.01, 0.99, (len(ones), 50))
    return ones, system, low[:, None] + inside * (high - low)[:, None]


@pytest.fixture(scope="module")
def table():
    """All elementary functions of one argument, as one field."""
    return field_of([f for f in FUNCTIONS.values() if f.arity == 1])


class TestTheTable:
    def test_values_in_every_engine(self, table):
        ones, system, y = table
        wanted = np.array([[f.value(x) for x in row] for f, row in zip(ones, y.tolist(), strict=True)])
        size = np.maximum(np.abs(wanted), 1e-3)
        found = {"numpy": targets.numpy(system, "field")(0.0, y, np.empty(0))}
        compiled, jax = targets.numba(system, "field"), targets.jax(system, "field")
        found["numba"], found["jax"] = np.empty_like(y), np.empty_like(y)
        for i in range(y.shape[1]):
            out = np.empty(len(ones))
            compiled(0.0, y[:, i].copy(), np.empty(0), out)
            found["numba"][:, i] = out
            found["jax"][:, i] = jax(0.0, y[:, i], np.empty(0))
        for engine, values in found.items():
            # Measured 3.4e-16.
            error = (np.abs(values - wanted) / size).max(axis=1)
            assert error.max() < 1e-15, (engine, ones[int(error.argmax())].name)

    def test_heyoka_has_them(self, table):
        hy = pytest.importorskip("heyoka")
        ones, system, y = field_of([f for f in table[0] if f.heyoka is not None])
        variables, values = zip(*targets.heyoka(system), strict=True)
        found = hy.cfunc(list(values), vars=list(variables))(y)
        wanted = targets.numpy(system, "field")(0.0, y, np.empty(0))
        error = (np.abs(found - wanted) / np.maximum(np.abs(wanted), 1e-3)).max(axis=1)
        assert error.max() < 1e-15, ones[int(error.argmax())].name  # measured 2.2e-16

    def test_derivatives(self, table):
        ones, system, y = field_of([f for f in table[0] if f.derivative is not None])
        jacobian = system.jacobian()
        assert jacobian.rows.tolist() == jacobian.columns.tolist() == list(range(len(ones)))
        found = targets.numpy(system, jacobian)(0.0, y, np.empty(0))
        for f, row, slopes in zip(ones, y, found, strict=True):
            exact = {"abs": mpmath.fabs}.get(f.name) or getattr(mpmath, f.name)
            with mpmath.workdps(40):
                wanted = np.array([float(mpmath.diff(exact, mpmath.mpf(x))) for x in row])
            # Measured 1.9e-16.
            assert np.abs(slopes - wanted).max() < 1e-15 * max(1.0, np.abs(wanted).max()), f.name

    def test_the_derivative_of_round_is_0(self):
        system = VectorField(lambda y, m: [m.round(y[0]) + y[1], y[0]], dim=2)
        assert system.jacobian().rows.tolist() == [0, 1]
        assert system.jacobian().columns.tolist() == [1, 0]

    def test_outside_its_domain_a_function_has_no_value(self):
        for f in FUNCTIONS.values():
            for end, outward in zip(f.domain, (-math.inf, math.inf), strict=True):
                if math.isfinite(end):
                    assert math.isfinite(f.value(end)), f.name
                    with pytest.raises((ValueError, OverflowError)):
                        f.value(math.nextafter(end, outward))

    @pytest.mark.parametrize("x", [-1.5, -1.0, -0.0, 0.0, 0.4, 1.0, 2.5, 2.0**52 + 1.0])
    def test_floor_and_sign_are_exact_where_they_jump(self, x):
        system = VectorField(lambda y, m: [m.floor(y[0]), m.sign(y[0]), m.abs(y[0])], dim=3)
        y, wanted = np.array([x, 0.0, 0.0]), [math.floor(x), np.sign(x), abs(x)]
        out = np.empty(3)
        targets.numba(system, "field")(0.0, y, np.empty(0), out)
        assert out.tolist() == wanted
        assert targets.numpy(system, "field")(0.0, y, np.empty(0)).tolist() == wanted
        assert targets.jax(system, "field")(0.0, y, np.empty(0)).tolist() == wanted
        assert FUNCTIONS["floor"].value(x) == wanted[0]
        assert FUNCTIONS["sign"].value(x) == wanted[1]


def test_steps_end_where_the_whole_part_of_a_number_changes():
    teeth = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + 2 * (q[0] - m.floor(q[0]) - 0.5) ** 2, dof=1)
    solution = integrate(Problem(teeth, q0=[0.3], p0=[1.3], t_end=3.0), HBVM(), [3.0])
    assert solution.errors()["energy"].max() < 2e-15  # measured 1.04e-15
    assert solution.y[0, 0] > 2.0  # over two kinks at least
    rising = Problem(VectorField(lambda t, m: [t - m.floor(t)], dim=1), y0=[0.0], t_end=4.25)
    # Measured 0.
    assert abs(integrate(rising, HBVM(), [4.25]).y[-1, 0] - (4 * 0.5 + 0.25**2 / 2)) < 1e-14


def test_steps_end_where_a_rounded_number_changes():
    wells = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + 2 * (q[0] - m.round(q[0])) ** 2, dof=1)
    over = Problem(wells, q0=[0.3], p0=[1.3], t_end=3.0)  # five kinks
    solution = integrate(over, HBVM(), [3.0])
    assert solution.errors()["energy"].max() < 1e-15  # measured 3e-17; before, steps did not see the surface
    teeth = Problem(VectorField(lambda t, m: [t - m.round(t)], dim=1), y0=[0.0], t_end=4.25)
    assert abs(integrate(teeth, HBVM(), [4.25]).y[-1, 0] - 0.25**2 / 2) < 1e-14  # measured 0


# Arguments, and a bound on the relative error in double-double: measured 1.5e-31 (erf; the others 3e-32).
UNARY = {
    "asinh": (-1e20, 1e20, 1e-30),
    "acosh": (1.0, 1e20, 1e-30),
    "atanh": (-0.9999, 0.9999, 1e-30),
    "expm1": (-700.0, 700.0, 1e-30),
    "log1p": (-0.9999, 1e10, 1e-30),
    "sinh": (-20.0, 20.0, 1e-30),
    "cosh": (-20.0, 20.0, 1e-30),
    "tanh": (-60.0, 60.0, 1e-30),
    "asin": (-1.0, 1.0, 1e-30),
    "acos": (-1.0, 1.0, 1e-30),
    "atan": (-1e6, 1e6, 1e-30),
    "erf": (-12.0, 12.0, 1e-30),
    "erfc": (-12.0, 25.0, 3e-29),  # measured 1.2e-29, just below 2
}


class TestDoubleDouble:
    @pytest.mark.parametrize("name", UNARY)
    def test_against_mpmath(self, name):
        @settings(max_examples=80, deadline=None, derandomize=True)
        @given(st.floats(*UNARY[name][:2]), st.floats(-1e-17, 1e-17))
        def check(x, tail):
            if abs(x) == 1.0 or 0.0 < abs(x) < 1e-200:
                return
            low = float(np.float64(x) * tail)
            with mpmath.workdps(60):
                exact = getattr(mpmath, name)(mpmath.mpf(x) + mpmath.mpf(low))
                found = FUNCTIONS[name].double_double(DD(np.array([x]), np.array([low])))
                error = mpmath.mpf(float(found.hi[0])) + mpmath.mpf(float(found.lo[0])) - exact
                assert abs(error) <= UNARY[name][2] * max(
                    abs(exact), mpmath.mpf(1e-3) if name == "acos" else 0
                )

        check()

    @pytest.mark.parametrize(("name", "exact"), [("round", mpmath.nint), ("floor", mpmath.floor)])
    def test_whole_numbers_by_both_halves(self, name, exact):
        high, low = np.array([2.5, 2.5, 2.5, 2.5**40, -3.5, 2.0**53, 0.4]), np.zeros(7)
        low[1:3], low[4], low[5] = (1e-17, -1e-17), 1e-17, 0.75
        found = FUNCTIONS[name].double_double(DD(high, low))
        with mpmath.workdps(60):
            for i in range(7):
                wanted = exact(mpmath.mpf(high[i]) + mpmath.mpf(low[i]))
                assert mpmath.mpf(float(found.hi[i])) + mpmath.mpf(float(found.lo[i])) == wanted

    def test_atan2_in_all_quadrants(self):
        y, x = np.array([1.0, 1.0, -1.0, -1.0, 0.0, 2.0]), np.array([3.0, -3.0, -3.0, 3.0, -1.0, 0.0])
        found = FUNCTIONS["atan2"].double_double(DD(y), DD(x))
        with mpmath.workdps(60):
            for i in range(y.size):
                exact = mpmath.atan2(y[i], x[i])
                assert abs(mpmath.mpf(float(found.hi[i])) + mpmath.mpf(float(found.lo[i])) - exact) < 1e-31

    def test_the_energy_of_a_state(self):
        y = np.array([[0.3, -0.2, 0.1, 0.4]])
        for name in ("tanh", "erf", "atan2"):
            problem = Problem(system_of(name), y0=y[0], t_end=1.0)
            found = problem.invariants(y)["energy"][0]
            exact = {
                "tanh": lambda x, z: mpmath.tanh(3 * x) * z,
                "erf": lambda x, z: mpmath.erf(2 * x) + z * z,
                "atan2": lambda x, z: mpmath.atan2(z + 2, x),
            }[name]
            with mpmath.workdps(40):
                q0, q1, p0, p1 = (mpmath.mpf(float(v)) for v in y[0])
                assert found == float((p0**2 + p1**2) / 2 + exact(q0, q1))


class TestTables:
    def test_outside_the_outer_pieces_go_on_as_scipys(self):
        system = VectorField(lambda t, m: [m.table(t, KNOTS, POINTS)], dim=1)
        for t in (-3.0, -2.0, 0.5, 2.0, 2.5):
            found = targets.numpy(system, "field")(t, np.zeros(1), np.empty(0))[0]
            assert found == pytest.approx(float(SPLINE(t)), rel=1e-13)

    @pytest.mark.parametrize("method", [HBVM(), Gauss(s=6, tol=1e-15)], ids=repr)
    def test_steps_land_on_the_knots_of_a_table_of_time(self, method):
        times = np.linspace(0.0, 10.0, 21)
        values = np.random.default_rng(5).uniform(-1.0, 1.0, 21)
        system = VectorField(lambda t, y, m: [y[1], -y[0] + m.table(t, times, values)], dim=2)
        assert Switches(system).times(system.pack(), 0.0, 1.0)[0].tolist() == times.tolist()
        problem = Problem(system, y0=[1.0, 0.0], t_end=10.0)
        steps = integrate(problem, method, times=[10.0], sample="steps")
        assert set(times[1:].tolist()) <= set(steps.t.tolist())
        # Exactly: y = cos t + the integral of sin(t - s) f(s).
        spline = CubicSpline(times, values)
        x, w = np.polynomial.legendre.leggauss(20)
        s = (times[:-1, None] + times[1:, None]) / 2 + x * 0.25
        exact = math.cos(10.0) + float((np.sin(10.0 - s) * spline(s) * w * 0.25).sum())
        # Measured 0.
        assert abs(steps.y[-1, 0] - exact) < 2e-15

    def test_jumps_in_time_are_landed_on(self):
        system = VectorField(lambda t, m: [m.where((t > 1.0) & (t < 2.5), 1.0, 0.0)], dim=1)
        assert Switches(system).times(system.pack(), 0.0, 1.0)[0].tolist() == [1.0, 2.5]
        solution = integrate(Problem(system, y0=[0.0], t_end=4.0), HBVM())
        # Measured 0.
        assert abs(solution.y[-1, 0] - 1.5) < 1e-15

    @pytest.mark.parametrize(
        ("xs", "ys"),
        [([0, 1], [1]), ([1, 0, 2], [0, 0, 0]), ([0, 1, np.nan], [0, 1, 2]), (3, 4), (KNOTS, [POINTS] * 6)],
    )
    def test_other_points_are_refused(self, xs, ys):
        with pytest.raises(InputError, match=r"m\.table cannot use these points"):
            Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + m.table(q[0], xs, ys), dof=1)

    @pytest.mark.parametrize("kind", ["linear", "previous"])
    @pytest.mark.parametrize("seed", range(10))
    def test_other_kinds_have_the_values_and_the_integral_of_scipys(self, kind, seed):
        rng = np.random.default_rng(seed)
        xs = np.cumsum(rng.uniform(0.1, 1.0, 8))
        ys = rng.uniform(-1.0, 1.0, 8)
        system = VectorField(lambda t, y, m: [m.table(t, xs, ys, kind=kind) - y[0] * 0], dim=1)
        expected = interp1d(xs, ys, kind=kind)
        field = targets.numpy(system, "field")
        for t in (*rng.uniform(xs[0], xs[-1], 5), *xs.tolist()):
            assert field(t, np.zeros(1), np.empty(0))[0] == pytest.approx(float(expected(t)), abs=1e-14)
            (value,) = evaluate(system.field, t, np.zeros((1, 1)), np.empty(0))
            assert value.rounded()[0] == pytest.approx(float(expected(t)), abs=1e-14)
        problem = pickle.loads(pickle.dumps(Problem(system, y0=[0.0], t0=xs[0], t_end=xs[-1])))
        solution = integrate(problem, HBVM(), [xs[-1]], sample="steps")
        widths, means = np.diff(xs), ys[:-1] if kind == "previous" else (ys[1:] + ys[:-1]) / 2
        assert solution.y[-1, 0] == pytest.approx(float(widths @ means), abs=1e-14)  # measured 5e-16
        assert set(xs[1:].tolist()) <= set(solution.t.tolist())

    @pytest.mark.parametrize(("kind", "shape"), [("cubic", (5, 9)), ("cubic", (8, 6)), ("linear", (5, 9))])
    def test_tables_in_two_dimensions_have_the_values_and_slopes_of_scipys(self, kind, shape):
        rng = np.random.default_rng(4)
        xs, ys = (np.cumsum(rng.uniform(0.1, 1.0, n)) for n in shape)
        zs = rng.uniform(-1.0, 1.0, shape)
        system = Hamiltonian(lambda q, m: m.table((q[0], q[1]), (xs, ys), zs, kind=kind), dof=2)
        degree = 3 if kind == "cubic" else 1
        expected = RectBivariateSpline(xs, ys, zs, kx=degree, ky=degree)
        at = np.stack([rng.uniform(x[0], x[-1], 20) for x in (xs, ys)])
        y = np.concatenate([at, np.zeros((2, 20))])
        values = targets.numpy(system, "hamiltonian")(0.0, y, np.empty(0))[0]
        assert values == pytest.approx(expected.ev(*at), abs=1e-13)  # measured 5.3e-15
        if kind == "cubic":
            slopes = [expected.ev(*at, dx=1), expected.ev(*at, dy=1)]
            field = targets.numpy(system, "field")(0.0, y, np.empty(0))
            assert field[2:] == pytest.approx(-np.stack(slopes), abs=1e-12)  # measured 1.5e-14

    def test_another_grid_is_refused(self):
        with pytest.raises(InputError, match=r"m\.table cannot use this grid .* shape \(3, 2\)"):
            Hamiltonian(lambda q, m: m.table((q[0], q[1]), ([0, 1], [0, 1, 2]), np.ones((3, 2))), dof=2)

    def test_a_previous_value_stays_after_the_last_point(self):
        system = VectorField(
            lambda t, m: [m.table(t, [0, 1, 2], [3, 4, 5], kind="previous", extrapolate=True)], dim=1
        )
        solution = integrate(Problem(system, y0=[0.0], t_end=4.0), HBVM())
        assert solution.y[-1, 0] == pytest.approx(3 + 4 + 10, abs=1e-14)  # measured 0

    def test_another_kind_is_refused(self):
        with pytest.raises(InputError, match=r"unknown kind of m\.table 'linar'; did you mean 'linear'"):
            VectorField(lambda t, m: [m.table(t, [0, 1], [0, 1], kind="linar")], dim=1)


class TestTablesBeyondTheirData:
    TIMES, VALUES = [0.0, 1.0, 2.0, 3.0, 10.0], [0.0, 1.0, 0.0, -1.0, 0.0]

    def forced(self, argument=lambda t: t, **options):
        system = VectorField(
            lambda t, y, m: [m.table(argument(t), self.TIMES, self.VALUES, **options)], dim=1
        )
        return Problem(system, y0=[0.0], t_end=10.0)

    @pytest.mark.parametrize("end", [10.5, -1.0, 100.0])
    def test_it_is_refused_before_the_run(self, end):
        for run in (
            lambda: integrate(self.forced(), HBVM(), [end]),
            lambda: integrate(self.forced(), DOP853(rtol=1e-8, atol=1e-8), [end]),
            lambda: integrate_many(self.forced(), HBVM(), starts=[[0.0]], times=[end]),
        ):
            with pytest.raises(InputError, match=r"data from 0.0 to 10.0.*extrapolate=True"):
                run()

    def test_within_the_data_it_is_not(self):
        assert integrate(self.forced(), HBVM(), [10.0]).status == "finished"
        assert integrate(self.forced(lambda t: t / 3), HBVM(), [30.0]).status == "finished"

    def test_on_request_the_outer_pieces_go_on(self):
        problem = self.forced(extrapolate=True)
        again = pickle.loads(pickle.dumps(problem))
        solution = integrate(again, HBVM(), [11.0])
        exact = float(CubicSpline(self.TIMES, self.VALUES).antiderivative()(11.0))
        assert solution.y[-1, 0] == pytest.approx(exact, rel=1e-13)

    @pytest.mark.parametrize(("end", "told"), [(0.9, False), (1.5, True)])
    def test_a_state_beyond_the_data_is_told(self, end, told):
        system = VectorField(lambda y, m: [1.0 + 0 * m.table(y[0], [0, 0.5, 1.0], [1, 2, 1])], dim=1)
        solution = integrate(Problem(system, y0=[0.0], t_end=2.0), HBVM(), [0.5, end])
        assert [one[:7] for one in solution.warnings if "m.table" in one] == ["at t = "] * told

    @pytest.mark.parametrize("seed", range(20))
    def test_random_arguments(self, seed):
        rng = np.random.default_rng(seed)
        slope, offset = rng.uniform(0.2, 2.0) * rng.choice([-1, 1]), rng.uniform(0.0, 10.0)
        end = float(rng.uniform(1.0, 10.0))
        inside = 0.0 <= slope * end + offset <= 10.0
        problem = self.forced(lambda t: slope * t + offset)
        if inside:
            assert integrate(problem, HBVM(), [end]).status == "finished"
        else:
            with pytest.raises(InputError, match="extrapolate=True"):
                integrate(problem, HBVM(), [end])


class TestWhere:
    def test_a_comparison_alone_is_still_refused(self):
        for formula in (
            lambda q, p, m: q[0] if q[0] > 0 else p[0],
            lambda q, p, m: max(q[0], p[0]),
            lambda q, p, m: q[0] if 0 < q[0] < 1 else p[0],
        ):
            with pytest.raises(InputError, match=r"compares or branches on a symbol.*m\.where"):
                Hamiltonian(formula, dof=1)
        with pytest.raises(InputError, match="compares or branches"):
            Hamiltonian(lambda q, p, m: m.where(q[0] == 0, q[0], p[0]), dof=1)
        with pytest.raises(InputError, match=r"m\.where chooses by"):
            Hamiltonian(lambda q, p, m: m.where(q[0], q[0], p[0]), dof=1)

    def test_a_wall_keeps_the_energy(self):
        wall = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + m.where(q[0] > 0, 50 * q[0] ** 2, 0.0), dof=1)
        assert structure.has_kinks(wall)
        problem = Problem(wall, q0=[-1.0], p0=[1.0], t_end=1.3)
        solution = integrate(problem, HBVM())
        # Measured 6.1e-13.
        assert solution.errors()["energy"].max() < 3e-12
        assert any("discontinuous" in sentence for sentence in solution.warnings)
        assert any("m.where" in sentence for sentence in integrate(problem, Taylor()).warnings)

    def test_what_numbers_decide_is_decided(self):
        assert Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + m.where(True, q[0], p[0]), dof=1).separable


def test_constants_and_domains():
    def value(formula):
        return targets.numpy(VectorField(formula, dim=1), "field")(0.0, np.zeros(1), np.empty(0))[0]

    assert value(lambda m: [m.erf(0.5)]) == math.erf(0.5)
    assert value(lambda m: [m.atan2(1, -1)]) == math.atan2(1.0, -1.0)
    assert value(lambda m: [m.where(m.tanh(1.0) > 0.5, 1, 2)]) == 1.0
    with pytest.raises(InputError, match=r"asin\(2.0\) is not defined"):
        value(lambda m: [m.asin(2)])
    with pytest.raises(InputError, match=r"cosh\(1000.0\) is not defined"):
        value(lambda m: [m.cosh(1000)])


def test_expressions_have_them_too():
    problem = problems.load("expression", H="p^2/2 + cosh(q) + erf(q)/3", q0=(0.4,), p0=(0.0,), t_end=5.0)
    # Measured 1.2e-16.
    assert integrate(problem, HBVM()).errors()["energy"].max() < 1e-15


PAGE = Path(__file__).parents[2] / "docs" / "formulas.md"


def test_the_page_names_all_functions():
    named = set(re.findall(r"(?:`m\.|`|m\.)(\w+)", PAGE.read_text()))
    assert {*FUNCTIONS, *OTHERS} <= named


def test_the_examples_of_the_page_are_true():
    result = doctest.testfile(str(PAGE), module_relative=False)
    assert result.attempted >= 12
    assert result.failed == 0


@pytest.mark.parametrize(
    ("formula", "plain"),
    [
        (lambda x: x**0.3, lambda x: x**0.3),
        (lambda x: x**-1.7, lambda x: x**-1.7),
        (lambda x: 2**x, lambda x: 2**x),
        (lambda x: x**x, lambda x: x**x),
        (lambda x: x % 0.7, lambda x: x % 0.7),
        (lambda x: 7.53 % x, lambda x: 7.53 % x),
        (lambda x: x // 0.7, lambda x: x // 0.7),
    ],
)
def test_python_operators_have_the_value_that_they_have_for_numbers(formula, plain):
    system = problems.VectorField(lambda y: [formula(y[0])], dim=1, name="operators")
    field = targets.numpy(system, "field")
    for x in (0.1, 0.65, 1.0, 3.2, 12.9):
        assert field(0.0, np.array([x]), system.pack())[0] == pytest.approx(plain(x), rel=4e-15, abs=4e-15)
    slope = targets.numpy(system, system.tangent("field", 1))(0.0, np.array([1.0, 3.2]), system.pack())[0]
    around = (plain(3.2 + 1e-6) - plain(3.2 - 1e-6)) / 2e-6
    assert slope == pytest.approx(around, rel=1e-8, abs=1e-8)  # measured 1e-9
