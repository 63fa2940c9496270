"""Steps of varying length where the field is not smooth, where the solution ends, and what they refuse."""

import math
from time import perf_counter

import numpy as np
import pytest

import integrators
import problems
from hbvm_bench.campaign.spec import parse_spec
from integrators import HBVM, Gauss, LineIntegral
from integrators.protocol import Status
from problems import Hamiltonian, Opaque, Problem, VectorField
from problems.errors import InputError

from .fault import Fault, is_met, sentence

FAULTS = [
    Fault("HBVM(max_step=0)", lambda: HBVM(max_step=0.0), r"max_step=0\.0 of HBVM must be a finite step"),
    Fault("HBVM(max_step=nan)", lambda: HBVM(max_step=math.nan), "max_step=nan"),
    Fault("HBVM(max_steps=0)", lambda: HBVM(max_steps=0), "max_steps=0 of HBVM must be a whole number"),
    Fault("HBVM(breakpoints=3)", lambda: HBVM(breakpoints=3.0), "must be a list of finite times"),  # pyright: ignore
    Fault("HBVM(breakpoints=[nan])", lambda: HBVM(breakpoints=[1.0, math.nan]), "list of finite times"),
    Fault(
        "HBVM(k=4, s=2, h=0.1, breakpoints=[1])",
        lambda: HBVM(k=4, s=2, h=0.1, breakpoints=[1.0]),
        "takes breakpoints with a tolerance only, not with h=0.1 alone; give tol",
    ),
    Fault("Gauss(s=2, h=0.1, max_steps=9)", lambda: Gauss(s=2, h=0.1, max_steps=9), "Gauss takes max_steps"),
]  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_is_refused(fault):
    is_met(fault)


START, END = 3.0, 3.005


def pulse():
    """An oscillator that is pushed by 100 for 0.005, and its exact state at 20."""

    def field(t, y, m):
        push = (t - START) / m.abs(t - START) - (t - END) / m.abs(t - END)
        return [y[1], -y[0] + 50.0 * push]

    def pushed(since):
        return np.array([100.0 * (1.0 - math.cos(20.0 - since)), 100.0 * math.sin(20.0 - since)])

    exact = np.array([math.cos(20.0), -math.sin(20.0)]) + pushed(START) - pushed(END)
    return Problem(VectorField(field, dim=2, name="pulse"), y0=[1.0, 0.0], t_end=20.0), exact


@pytest.mark.parametrize("sample", [None, "stop", "steps"])
@pytest.mark.parametrize("method", [HBVM(), HBVM(tol=1e-8), Gauss(s=4, tol=1e-10)], ids=repr)
def test_a_pulse_between_breakpoints_is_not_stepped_over(method, sample):
    problem, exact = pulse()
    options = {**method.options(), "breakpoints": [END, START]}
    solution = integrators.integrate(problem, type(method)(**options), [1.0, START, 20.0], sample=sample)
    assert solution.status is Status.FINISHED
    assert solution.warnings == ()
    if sample == "steps":
        assert {START, END} <= set(solution.t)
    else:
        assert np.abs(solution.y[-1] - exact).max() < 1e-9  # measured 9e-14 to 1e-10; without, 0.5


def test_breakpoints_hold_on_the_way_back_and_are_read_from_a_command_line():
    problem, _ = pulse()
    spec = parse_spec("HBVM(breakpoints=[3.0, 3.005], max_step=2, max_steps=500)")
    method = HBVM(**spec.arguments)
    assert repr(method) == "HBVM(max_step=2.0, breakpoints=(3.0, 3.005), max_steps=500)"
    stepper = method.compile(problem.system).start(problem.y0, problem.par, 0.0)
    stepper.advance([20.0], sample="stop")
    back = stepper.advance([0.0], sample="stop").y[-1]
    assert np.abs(back - problem.y0).max() < 1e-12  # measured 6e-16


OSCILLATOR = VectorField(lambda y: [y[1], -y[0]], dim=2, name="oscillator")


@pytest.mark.parametrize("sample", [None, "steps"])
def test_a_breakpoint_at_zero_is_passed(sample):
    # Time is rounded at the size of a step there: 8 of 40 such starts went backwards for ever.
    method = HBVM(breakpoints=[0.0], max_steps=1000)
    program = method.compile(OSCILLATOR)
    for i in range(40):
        t0 = -(1.0 + 0.137 * i)
        samples = program.start([1.0, 0.0], t0=t0).advance([5.0], sample=sample)
        assert samples.status is Status.FINISHED, t0
        exact = [math.cos(samples.t[-1] - t0), -math.sin(samples.t[-1] - t0)]
        assert np.abs(samples.y[-1] - exact).max() < 1e-13  # measured 2e-15
        assert sample is None or 0.0 in samples.t


@pytest.mark.parametrize("apart", [1e-15, 2e-15, 3e-15, 5e-15])
def test_breakpoints_that_no_step_fits_between_are_one(apart):
    method = HBVM(breakpoints=np.array([1.0 + apart, 1.0]))
    for t0 in (0.0, 1.0):
        solution = integrators.integrate(Problem(OSCILLATOR, y0=[1.0, 0.0], t0=t0, t_end=3.0), method, [3.0])
        assert solution.status is Status.FINISHED


def test_a_largest_step_that_is_none_is_named():
    problem = Problem(OSCILLATOR, y0=[1.0, 0.0], t0=1.0, t_end=3.0)
    solution = integrators.integrate(problem, HBVM(max_step=1e-15), [3.0])
    assert solution.status is Status.STEP_UNDERFLOW
    sentence(solution.reason, r"a step of max_step=1e-15 from t = 1\.0 cannot be told from none; give more")


def test_a_pulse_is_seen_with_a_largest_step():
    width = 0.005

    def field(t, y, m):
        return [m.exp(-(((t - 3.0) / width) ** 2))]

    problem = Problem(VectorField(field, dim=1, name="bump"), y0=[1.0], t_end=20.0)
    exact = 1.0 + width * math.sqrt(math.pi)
    missed, seen = (
        integrators.integrate(problem, method, [20.0]).y[-1, 0] for method in (HBVM(), HBVM(max_step=0.03))
    )
    assert abs(missed - exact) > 1e-3  # nobody can know: the reason for the option
    assert abs(seen - exact) < 1e-13  # measured 2e-16 to 1e-14
    steps = integrators.integrate(problem, HBVM(max_step=0.5), sample="steps")
    assert np.diff(steps.t).max() <= 0.5 * (1.0 + 1e-12)


def bounce(t):
    """Return q and p at t of H = p^2/2 + |q| from q = 1 at rest."""
    quarter = math.sqrt(2.0)
    part = t % (4.0 * quarter)
    if part <= quarter:
        return 1.0 - part * part / 2.0, -part
    if part <= 3.0 * quarter:
        v = part - 2.0 * quarter
        return -(1.0 - v * v / 2.0), v
    v = part - 4.0 * quarter
    return 1.0 - v * v / 2.0, -v


@pytest.mark.parametrize(
    ("method", "most"),
    [
        (HBVM(), 1e-9),  # measured 1e-11; a step underflow before
        (HBVM(k=8, s=4, tol=1e-10), 1e-6),  # 9e-9; 8.5e-6
        (Gauss(s=4, tol=1e-10), 1e-7),  # 5e-10; 0.48
    ],
    ids=repr,
)
def test_a_jump_of_the_force_is_found_and_named(method, most):
    valley = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + m.abs(q[0]), dof=1, name="valley")
    solution = integrators.integrate(Problem(valley, q0=[1.0], p0=[0.0], t_end=20.3), method, [20.3])
    assert solution.status is Status.FINISHED
    assert np.abs(solution.y[-1] - bounce(20.3)).max() < most
    kinks = solution.stats.extra["kinks"]
    crossings = math.sqrt(2.0) * np.arange(1, 15, 2)
    assert min(np.abs(crossings - t).min() for t, _ in kinks) < 1e-2
    (warning,) = solution.warnings
    sentence(warning, "the right-hand side or one of its derivatives is discontinuous .* give breakpoints")


def test_the_places_of_kinks_are_kept_the_first_first_and_go_with_a_checkpoint():
    valley = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + m.abs(q[0]), dof=1, name="valley")
    program = HBVM(k=8, s=4, tol=1e-10).compile(valley)
    stepper, other = (program.start([1.0, 0.0]) for _ in range(2))
    stepper.advance([10.0])
    other.restore(stepper.checkpoint())
    kinks = stepper.stats.extra["kinks"]
    assert [round(t / math.sqrt(2.0)) for t, _ in kinks][-3:] == [3, 5, 7]  # at 1 a step may have ended
    assert other.stats.extra["kinks"] == kinks
    stepper.advance([500.0])
    assert len(stepper.stats.extra["kinks"]) == 64
    assert stepper.stats.extra["kinks"][: len(kinks)] == kinks
    back = program.start([1.0, 0.0])
    back.advance([-10.0])
    assert [t for t, _ in back.stats.extra["kinks"]] == [-t for t, _ in kinks]


@pytest.mark.parametrize(
    ("method", "most"),
    [(HBVM(), 1e-10), (HBVM(k=8, s=4, tol=1e-10), 1e-6)],  # measured 3e-13, 3e-9; 4.6e-5, 6.1e-6 before
    ids=repr,
)
def test_a_kink_of_the_force_costs_no_more_than_the_tolerance(method, most):
    # y'' = -y + 0.9 |y|: two frequencies
    kink = VectorField(lambda y, m: [y[1], -y[0] + 0.9 * m.abs(y[0])], dim=2, name="kink")
    slow, fast = math.sqrt(0.1), math.sqrt(1.9)
    period = math.pi / slow + math.pi / fast
    solution = integrators.integrate(Problem(kink, y0=[1.0, 0.0], t_end=8 * period), method, [8 * period])
    assert solution.status is Status.FINISHED
    assert np.abs(solution.y[-1] - [1.0, 0.0]).max() < most


def test_a_look_at_the_ends_asks_for_two_values_of_the_field():
    asked = []

    def field(t, y):
        asked.append(t)
        return [y[1], -y[0] - 0.9 * abs(y[0])]

    problem = Problem(Opaque(field, dim=2), y0=[1.0, 0.0], t_end=20.0)
    stats = integrators.integrate(problem, HBVM(k=8, s=4, tol=1e-8), [20.0]).stats
    assert stats.extra["kinks"]
    assert len(asked) - stats.evaluations in (0, 1)  # the first length takes one; 193 before


@pytest.mark.parametrize(
    "method",
    [
        HBVM(), HBVM(k=8, s=4, tol=1e-3), HBVM(k=8, s=4, tol=1e-6), HBVM(k=7, s=4, tol=1e-10),
        HBVM(k=6, s=3, tol=1e-2), HBVM(k=5, s=3, tol=1e-10), HBVM(k=4, s=2, tol=1e-3),
        HBVM(k=4, s=3, tol=1e-6), HBVM(k=4, s=3, tol=1e-10), Gauss(s=4, tol=1e-6), Gauss(s=4, tol=1e-10),
        Gauss(s=8, tol=1e-5),
    ],
    ids=repr,
)  # fmt: skip
def test_smooth_fields_have_no_kinks(method):
    # With k = 4 and loose tolerances double_pendulum, lennard_jones, sitnikov and solar_system had some.
    for name in ("kepler", "sitnikov", "double_pendulum", "lennard_jones", "henon_heiles"):
        problem = problems.load(name)
        end = problem.t0 + min(problem.t_end - problem.t0, 100.0)
        solution = integrators.integrate(problem, method, [end])
        assert "kinks" not in solution.stats.extra, name
        assert solution.warnings == ()


@pytest.mark.parametrize(
    ("method", "why"),
    [
        (HBVM(k=4, s=2, h=0.1), "fixed steps are not cut there"),
        (LineIntegral(k=8, s=4, tol=1e-10, invariants=["energy"]), "do not detect discontinuities"),  # 2e-3
    ],
    ids=repr,
)
def test_who_does_not_look_for_kinks_says_so(method, why):
    valley = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + m.abs(q[0]), dof=1, name="valley")
    solution = integrators.integrate(Problem(valley, q0=[1.0], p0=[0.0], t_end=2.0), method, [2.0])
    warning, *more = solution.warnings
    sentence(warning, why)
    assert all(said.startswith("energy has") for said in more)  # LineIntegral's, over the jump
    assert method.caveat(problems.load("kepler")) is None


@pytest.mark.parametrize("method", [Gauss(s=6, tol=1e-12), HBVM(k=7, s=4, tol=1e-12)], ids=repr)
def test_few_nodes_on_a_field_that_is_not_traced_are_said(method):
    # A jump of it cost 1.2e-3 with Gauss(6), and nothing was said.
    jump = Problem(Opaque(lambda t, y: [-y[0] + (1.0 if t > 1.3 else -1.0)], dim=1), y0=[1.0], t_end=5.0)
    (warning, *_) = integrators.integrate(jump, method, [5.0]).warnings
    sentence(warning, r"not traced, in which k=\d nodes .* give breakpoints or k >= 8")
    told = type(method)(**{**method.options(), "breakpoints": [1.3]})
    solution = integrators.integrate(jump, told, [5.0])
    exact = 1.0 + (2.0 * math.exp(-1.3) - 2.0) * math.exp(-3.7)
    assert solution.warnings == ()
    assert abs(solution.y[-1, 0] - exact) < 1e-10  # measured 1.6e-14


def test_newton_steps_say_that_they_do_not_look_for_kinks_in_time():
    # A stiff linear field whose switch in time cannot be solved for: the implicit solver takes over.
    def field(t, y, m):
        return [-2000.0 * y[0] + y[1] + m.abs(m.sin(t / 100.0) + 5.0), -y[1]]

    problem = Problem(VectorField(field, dim=2, name="stiff"), y0=[1.0, 1.0], t_end=20.0)
    solution = integrators.integrate(problem, HBVM(k=8, s=4, tol=1e-6), [20.0])
    assert solution.stats.extra["implicit"]["steps"] > 0
    (warning,) = solution.warnings
    sentence(warning, r"not detected in its \d+ Newton steps")


@pytest.mark.parametrize("method", [Gauss(s=4, tol=1e-10, solver="newton"), Gauss(s=3, tol=1e-8)], ids=repr)
def test_a_formula_tells_where_it_switches_whatever_the_solver(method):
    # Off by 0.485 and 2.26 where only nodes were to show it.
    valley = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + m.abs(q[0]), dof=1, name="valley")
    solution = integrators.integrate(Problem(valley, q0=[1.0], p0=[0.0], t_end=2.0), method, [2.0])
    reached = math.sqrt(2.0)
    since = 2.0 - reached
    expected = [-reached * since + since * since / 2.0, since - reached]
    assert np.abs(solution.y[-1] - expected).max() < 1e-7
    assert len(solution.warnings) == 1
    sentence(
        solution.warnings[0],
        "the right-hand side or one of its derivatives is discontinuous .* give breakpoints",
    )


def test_heyoka_says_that_it_does_not_see_a_kink():
    pytest.importorskip("heyoka")
    valley = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 + m.abs(q[0]), dof=1, name="valley")
    problem = Problem(valley, q0=[1.0], p0=[0.0], t_end=2.0)
    solution = integrators.integrate(problem, integrators.Taylor(), [2.0])
    (warning,) = solution.warnings
    sentence(warning, r"its field has m\.abs")
    assert integrators.Taylor().caveat(problems.load("kepler")) is None


def spiral():
    """z' = z |z|^2 + i z |z|^4, which ends at t = 1/2 after infinitely many turns."""

    def field(y):
        r = y[0] * y[0] + y[1] * y[1]
        return [y[0] * r - y[1] * r * r, y[1] * r + y[0] * r * r]

    return VectorField(field, dim=2, name="spiral")


@pytest.mark.parametrize("end", [0.5000001, 1e6])
@pytest.mark.parametrize("method", [HBVM(), Gauss(s=4, tol=1e-8)], ids=repr)
def test_a_blow_up_is_seen_and_its_time_named(method, end):
    problem = Problem(spiral(), y0=[1.0, 0.0], t_end=end)
    program = method.compile(problem.system)
    program.start(problem.y0).advance([0.1])
    started = perf_counter()
    stepper = program.start(problem.y0)
    samples = stepper.advance([0.1, 0.4, end])
    assert perf_counter() - started < 3.0  # measured 0.05 to 0.35; 600,000 steps and 5.6 s before
    assert samples.status is Status.STALLED
    assert samples.t.tolist() == [0.1, 0.4]
    sentence(stepper.reason, r"seems to blow up at t = 0\.(4999|5000)")


def test_a_close_approach_is_no_blow_up():
    # From the apocentre of an orbit with e = 0.99999; was taken for a blow-up at the pericentre.
    e = 0.99999
    system = problems.load("kepler").system
    start = {"q0": [1.0 + e, 0.0], "p0": [0.0, math.sqrt((1.0 - e) / (1.0 + e))]}
    problem = Problem(system, **start, t_end=3.5)
    solution = integrators.integrate(problem, HBVM(k=6, s=2, tol=1e-15), [3.5])
    assert solution.status is Status.FINISHED
    assert solution.t_stop == 3.5


def test_oscillations_that_become_faster_are_no_blow_up():
    faster = VectorField(lambda y: [y[1], -y[0] * y[2], y[2]], dim=3, name="faster")
    problem = Problem(faster, y0=[1.0, 0.0, 1.0], t_end=21.0)
    solution = integrators.integrate(problem, HBVM(tol=1e-8), [21.0])
    assert solution.status is Status.FINISHED
    assert solution.stats.steps > 16_384  # measured 26,000


@pytest.mark.parametrize("sample", [None, "steps"])
def test_a_budget_of_steps_ends_the_run_with_its_status(sample):
    problem = problems.load("kepler", t_end=60.0)
    solution = integrators.integrate(problem, HBVM(max_steps=20), np.linspace(0.0, 60.0, 61), sample=sample)
    assert solution.status is Status.MAX_STEPS
    assert solution.stats.steps == 20
    assert 0.0 < solution.t_stop < 60.0
    assert solution.t.size > 1
    sentence(solution.reason, r"max_steps=20 steps came to t = \d")
    enough = integrators.integrate(problem, HBVM(max_steps=5000), [60.0])
    assert np.array_equal(enough.y, integrators.integrate(problem, HBVM(), [60.0]).y)


@pytest.mark.parametrize("sample", [None, "steps"])
def test_a_budget_of_just_the_steps_needed_is_enough(sample):
    problem = problems.load("kepler", t_end=20.0)
    needed = integrators.integrate(problem, HBVM(), [20.0]).stats.steps
    enough = integrators.integrate(problem, HBVM(max_steps=needed), [0.0, 20.0], sample=sample)
    assert (enough.status, enough.stats.steps) == (Status.FINISHED, needed)
    less = integrators.integrate(problem, HBVM(max_steps=needed - 1), [0.0, 20.0], sample=sample)
    assert (less.status, less.stats.steps) == (Status.MAX_STEPS, needed - 1)


def test_a_budget_is_that_of_the_trajectory_also_after_going_back():
    problem = problems.load("kepler")
    stepper = HBVM(max_steps=50).compile(problem.system).start(problem.y0, problem.par)
    start = stepper.checkpoint()
    for _ in range(4):
        assert stepper.advance([20.0]).status is Status.FINISHED  # 38 steps
        stepper.restore(start)
    assert stepper.stats.steps > 150


@pytest.mark.parametrize("scale", [1e-160, 1e-100, 1e100, 1e160])
def test_the_error_is_estimated_in_any_unit(scale):
    field = VectorField(lambda y: [y[1], -y[0]], dim=2, name="oscillator")
    steps = [
        integrators.integrate(Problem(field, y0=[size, size], t_end=20.0), HBVM(k=8, s=4, tol=1e-8), [20.0])
        for size in (1.0, scale)
    ]
    assert steps[1].status is Status.FINISHED
    assert abs(steps[1].stats.steps - steps[0].stats.steps) <= 5  # of 48
    assert np.abs(steps[1].y / scale - steps[0].y).max() < 1e-7  # measured 0 to 3e-9


def test_a_wrong_option_is_an_input_error():
    with pytest.raises(InputError, match="did you mean 'max_step'"):
        integrators.registry.create("HBVM", max_stp=1.0)


def test_times_one_ulp_apart_lose_nothing():
    # An ulp of t was lost for each pair: 5.7e-6 here.
    t0 = 1e9
    first = t0 + np.linspace(0.5, 25.0, 50)
    times = np.sort(np.concatenate([first, np.nextafter(first, np.inf)]))
    solution = integrators.integrate(
        Problem(OSCILLATOR, y0=[1.0, 0.0], t0=t0, t_end=t0 + 30.0), HBVM(), times, sample="stop"
    )
    exact = np.column_stack([np.cos(times - t0), -np.sin(times - t0)])
    assert np.abs(solution.y - exact).max() < 4e-7  # measured 1.2e-7, an ulp of t: such times count as one
