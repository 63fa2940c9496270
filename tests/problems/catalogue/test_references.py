"""The stored references: their invariants, the exact solutions, a third computation."""

from decimal import Decimal

import mpmath
import numpy as np
import pytest

import problems
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.reference import solutions as reference
from hbvm_bench.reference import trusted
from integrators.extended import collocation
from problems import targets
from problems.catalogue import kepler, morse, pendulum
from problems.errors import InputError
from problems.graph.nodes import reachable

STORED = sorted(path.stem for path in reference.folder().glob("*.json"))


def _load(stem):
    stored = reference.read(reference.folder() / f"{stem}.json")
    return stored, make_problem(stored.problem)


def _evaluate(problem, function, y):
    """Evaluate a function of a system on mpmath numbers."""
    inputs = {"y": y, "par": [mpmath.mpf(x) for x in problem.par.tolist()]}
    known: dict[int, object] = {}

    def value(node, row):
        match node.op:
            case "const":
                return mpmath.mpf(node.data)
            case "symbol":
                space, place = node.data
                return inputs[space][place if isinstance(place, int) else int(place.values(node.loop)[row])]
            case "sum":
                body = [n for n in reachable([node.args[0]]) if n.loop is node.data]
                total = mpmath.mpf(0)
                for i in range(len(node.data)):
                    inner: dict[int, object] = {}
                    for n in body:
                        inner[n.id] = operation(n, inner, i)
                    total += inner[node.args[0].id]
                return total
        return None

    def operation(node, here, row):
        found = value(node, row)
        if found is not None:
            return found
        args = [here[arg.id] if arg.id in here else known[arg.id] for arg in node.args]
        match node.op:
            case "add":
                return args[0] + args[1]
            case "sub":
                return args[0] - args[1]
            case "mul":
                return args[0] * args[1]
            case "div":
                return args[0] / args[1]
            case "neg":
                return -args[0]
            case "pow":
                return args[0] ** node.data
        return getattr(mpmath, {"abs": "fabs"}.get(node.op, node.op))(args[0])

    roots = [term.node for terms in function.outputs for term in terms]
    for node in reachable(roots):
        if node.loop is None:
            known[node.id] = operation(node, known, 0)
    return [known[root.id] for root in roots]


@pytest.mark.parametrize("stem", STORED)
def test_invariants_are_constant_along_a_reference_to_its_own_precision(stem):
    stored, problem = _load(stem)
    # More than what two computations agree on: measured at most 1e-27 (outer_solar_system), and for
    # large systems, of which fewer digits are kept, 3e-21 (fput).
    bound = mpmath.mpf(1e-24 if problem.system.dim <= trusted.SMALL else 1e-18)
    start = problem.invariants(problem.y0)
    kept = np.array([[float(x) for x in row] for row in stored.y])
    # What momenta and angular momenta that start at 0 are made of.
    terms = mpmath.mpf(float(np.abs(kept).max() * np.abs(kept[:, problem.system.dof :]).max()))
    with mpmath.workdps(45):
        rows = [[mpmath.mpf(x) for x in stored.y[i]] for i in (0, len(stored.y) // 2, len(stored.y) - 1)]
        for name, function in problem.system.invariants.items():
            first, *others = (_evaluate(problem, function, row) for row in rows)
            size = mpmath.sqrt(sum(x * x for x in first)) if start[name].any() else terms
            for values in others:
                gap = mpmath.sqrt(sum((a - b) ** 2 for a, b in zip(values, first, strict=True)))
                assert gap <= bound * size, name


@pytest.mark.parametrize("stem", STORED)
def test_every_reference_belongs_to_a_problem_and_says_how_it_was_made(stem):
    stored, problem = _load(stem)
    assert reference.find(problem) is not None
    assert stored.start == reference.start(problem)
    assert len(stored.t) == len(stored.y) >= 2
    assert all(len(row) == problem.system.dim for row in stored.y)
    assert {"method", "check", "agreement"} <= set(stored.provenance)
    apart = float(stored.provenance["agreement"].split(" ")[0])
    assert apart <= (1e-20 if problem.system.dim <= trusted.SMALL else 1e-15)
    assert targets.fingerprint(problem.system) == stored.provenance["field"]
    if stem != "sitnikov":  # at the seed paper's own times
        times = [float.fromhex(t) for t in stored.t]
        grid = trusted.GRID
        every = problem.t0 + (problem.t_end - problem.t0) * np.arange(grid + 1) / grid
        assert set(times) <= set(every.tolist()), "they are among the bench's own samples"


def test_every_problem_of_the_catalogue_has_a_reference():
    assert {_load(stem)[1].name for stem in STORED} >= set(problems.names())
    # Over the whole span, but for what is chaotic and for the planets' shared shorter one.
    shorter = {"henon_heiles", "pythagorean", "lennard_jones", "solar_system"}
    for stem in STORED:
        stored, problem = _load(stem)
        end = float.fromhex(stored.t[-1])
        assert end == problem.t_end or (problem.name in shorter and end >= 0.003 * problem.t_end), stem


@pytest.mark.parametrize(
    ("stem", "exact"),
    [
        ("kepler", kepler.exact_state),
        ("kepler_eccentric", kepler.exact_state),
        ("pendulum", pendulum.exact_state),
        ("morse", morse.exact_state),
    ],
)
def test_references_are_the_exact_solutions_where_there_are_any(stem, exact):
    stored, problem = _load(stem)
    with mpmath.workdps(50):
        for t, row in zip(stored.t[1::7], stored.y[1::7], strict=True):
            solution = exact(problem, mpmath.mpf(float.fromhex(t)))
            gap = max(abs(mpmath.mpf(a) - b) for a, b in zip(row, solution, strict=True))
            assert gap < mpmath.mpf("1e-22")  # measured at most 8e-25 (kepler_eccentric: 2e-24)


def test_the_collocation_is_as_exact_as_its_arithmetic():
    problem = problems.load("kepler")
    at = np.array([0.0, 1.0])
    found = collocation.integrate(problem, at)
    with mpmath.workdps(50):
        for t, row in zip(at.tolist(), found.tolist(), strict=True):
            solution = kepler.exact_state(problem, mpmath.mpf(t))
            gaps = [abs(mpmath.mpf(a.real) + a.imag - b) for a, b in zip(row, solution, strict=True)]
            assert max(gaps) < mpmath.mpf("1e-26")  # measured 2e-29 at t = 10


def test_recomputing_a_reference_gives_it_back():
    stored, problem = _load("kepler")
    at = np.array([float.fromhex(t) for t in stored.t[:3]])
    opinions = trusted.ask(problem, at)
    assert opinions.agreed == 3
    gaps = [
        abs(a - Decimal(b))
        for row, kept in zip(opinions.states, stored.y, strict=False)
        for a, b in zip(row, kept, strict=True)
    ]
    assert max(gaps) < Decimal("1e-25")  # measured 0


def test_where_two_computations_part_the_reference_ends(monkeypatch):
    problem = problems.load("pendulum", t_end=20.0)
    true = collocation.integrate

    def strayed(problem, at, **options):
        found = true(problem, at, **options)
        found[np.asarray(at) > 10.0] += 1e-15
        return found

    monkeypatch.setattr(collocation, "integrate", strayed)
    made = trusted.make(problem)
    assert float.fromhex(made.t[-1]) == 10.0
    assert "t <= 10" in made.provenance["agreement"]
    monkeypatch.setattr(collocation, "integrate", lambda *a, **o: true(*a, **o) + 1e-10)
    with pytest.raises(InputError, match="differ by"):
        trusted.make(problem)


def test_the_horizon_must_lie_within_the_span():
    problem = problems.load("pendulum")
    assert trusted.times(problem, 10.0)[-1] == 10.0
    for until in (0.0, -1.0, 2000.0, 1e-9):
        with pytest.raises(InputError, match="until="):
            trusted.times(problem, until)
