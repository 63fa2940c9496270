"""Whatever takes a problem says what it wants where it is given a system, or something else."""

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import integrators
import problems
from integrators import HBVM, Event, Gauss, LineIntegral, Run, Taylor, integrate, to_rebound

SYSTEM = problems.Hamiltonian(lambda q, p: p[0] ** 2 / 2 + q[0] ** 2 / 2, dof=1)
WORDS = {
    "indicator": "megno",
    "problem": SYSTEM,
    "method": HBVM(),
    "method_of": HBVM,
    "steps": [0.1, 0.2, 0.4],
}
RECORDS = {"Run", "Solution", "Solutions", "PeriodicOrbit"}  # what functions return
SKIPPED = (".kernel", ".peers", ".plugins.diffrax", "._")


def _functions() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield every public function with an argument ``problem`` that must be given."""
    seen: set[Any] = set()
    for package in (integrators, problems):
        names = [module.name for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")]
        for module in (package.__name__, *names):
            if any(part in module for part in SKIPPED):
                continue
            try:
                found = importlib.import_module(module)
            except problems.MissingLibraryError:  # of a plugin whose library is not here
                continue
            for name in getattr(found, "__all__", ()):
                function = getattr(found, name)
                if not callable(function) or name in RECORDS or function in seen:
                    continue
                try:
                    taken = inspect.signature(function).parameters
                except ValueError:
                    continue
                seen.add(function)
                if "problem" in taken and taken["problem"].default is inspect.Parameter.empty:
                    yield name, function


FUNCTIONS = dict(_functions())


def test_the_functions_are_found() -> None:
    assert {"integrate", "integrate_many", "lyapunov", "periodic", "section", "megno"} <= {*FUNCTIONS}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_system_is_no_problem(name: str) -> None:
    taken = inspect.signature(FUNCTIONS[name]).parameters.values()
    given = {p.name: WORDS.get(p.name, 1.0) for p in taken if p.default is inspect.Parameter.empty}
    with pytest.raises(problems.InputError, match=r"a system without a start; give problems\.Problem\("):
        FUNCTIONS[name](**given)


def test_a_run_is_set_as_a_whole() -> None:
    run: Run = integrators.start(problems.load("henon_heiles"))
    with pytest.raises(problems.InputError, match=r"set the whole: y = run.y.copy\(\), then run.y = y"):
        run.y[0] = 1.0
    with pytest.raises(problems.InputError, match=r'set the whole: run.par = \{"name": value\}'):
        run.par["k"] = 1.0  # pyright: ignore[reportCallIssue, reportArgumentType]
    doubled = run.y * 2.0
    doubled[0] = 1.0
    assert doubled[0] == 1.0


def test_to_rebound_takes_the_last_state_of_a_solution() -> None:
    planets = problems.load("outer_solar_system")
    solution = integrate(planets, Gauss(s=4, h=5.0), [0.0, 100.0])
    simulation, same = to_rebound(solution), to_rebound(planets, solution.y[-1], t=100.0)
    assert simulation.t == 100.0
    assert [body.x for body in simulation.particles] == [body.x for body in same.particles]
    with pytest.raises(problems.InputError, match="give its problem, y= and t="):
        to_rebound(solution, solution.y[0])


def test_sympy_takes_single_symbols_and_says_that_equations_are_not_formed() -> None:
    sympy = pytest.importorskip("sympy")
    from sympy.physics import mechanics

    q, p = sympy.symbols("q p")
    single, listed = (problems.from_sympy(p**2 / 2 - sympy.cos(q), *given) for given in ((q, p), ([q], [p])))
    assert problems.Problem(single, q0=[1.0], p0=[0.0], t_end=1.0) == problems.Problem(
        listed, q0=[1.0], p0=[0.0], t_end=1.0
    )
    x, u = mechanics.dynamicsymbols("x u")
    velocity = mechanics.dynamicsymbols("x", 1)
    lagrange = mechanics.LagrangesMethod(velocity**2 / 2 - x**2 / 2, [x])
    with pytest.raises(problems.InputError, match=r"not formed; call its form_lagranges_equations\(\)"):
        problems.from_sympy(lagrange)
    frame = mechanics.ReferenceFrame("N")
    kane = mechanics.KanesMethod(frame, q_ind=[x], u_ind=[u], kd_eqs=[velocity - u])
    with pytest.raises(problems.InputError, match=r"not formed; call its kanes_equations\(\)"):
        problems.from_sympy(kane)


@pytest.mark.parametrize(
    ("problem", "method", "reason"),
    [
        ("henon_heiles", Taylor(), "does not offer; use HBVM or Gauss, or leave out then="),
        (
            "henon_heiles",
            LineIntegral(k=4, s=2, h=0.1, invariants=["energy"]),
            "it conserves invariants of the initial state; use HBVM or Gauss",
        ),
    ],
)
def test_an_action_is_refused_with_the_reason(problem: str, method: Any, reason: str) -> None:
    event = Event(lambda y: y[0], then=lambda y: [-x for x in y], name="kick")
    with pytest.raises(problems.InputError, match=reason):
        integrate(problems.load(problem), method, events=event)
