"""Events that change the state: ordinary impacts however close, accumulation, and starts on a surface."""

import math

import numpy as np
import pytest

from integrators import HBVM, Event, Gauss, Status, integrate, integrate_many
from problems import Hamiltonian, Problem, VectorField

from .search.impacts import END, WALLS, draw_polygon, draw_start

METHODS = [HBVM(), HBVM(k=4, s=2, h=0.37)]
FLIGHT = VectorField(lambda y: [y[1], 0.0 * y[0]], dim=2, name="flight on a line")
BALL = VectorField(lambda y: [y[1], -1.0 + 0.0 * y[0]], dim=2, name="ball")


def floor(restitution, **options):
    options = {"direction": -1} | options
    return Event(lambda y: y[0], then=lambda y: [y[0], -restitution * y[1]], name="floor", **options)


def check_billiards(seeds, *, on_wall):
    for seed in seeds:
        rng = np.random.default_rng([seed, int(on_wall)])
        polygon = draw_polygon(rng)
        y0 = draw_start(rng, polygon, on_wall=on_wall)
        impacts, last = polygon.follow(y0, END)
        for method in METHODS:
            found = integrate(polygon.problem(y0), method, [END], events=WALLS)
            assert found.status is Status.FINISHED, (seed, method, found.reason)
            walls = sorted((t, int(name[5:])) for name, each in found.events.items() for t in each.t)
            assert [wall for _, wall in walls] == [wall for _, wall in impacts], (seed, method)
            assert np.abs(found.y[-1] - last).max() < 1e-9, (seed, method)  # measured 3e-14


@pytest.mark.parametrize("on_wall", [False, True])
def test_a_point_in_a_polygon_meets_every_wall(on_wall):
    check_billiards(range(20), on_wall=on_wall)


@pytest.mark.slow
@pytest.mark.parametrize("on_wall", [False, True])
def test_so_it_does_in_hundreds_of_polygons(on_wall):
    check_billiards(range(100, 500), on_wall=on_wall)


def test_a_zero_beyond_the_first_one_is_no_accumulation():
    # Before: 'stalled' after 68 impacts, at one with a normal velocity of 7.3: the next zero was taken to be
    # at the start, where only the sign of the function is known.
    a, b, c, left, right, radius = -1.0, 1.5, 0.01, -0.6, 0.9, 0.05

    def energy(q, p, m):
        centres = [m.sqrt((q[0] - x) ** 2 + q[1] ** 2) for x in (left, right)]
        return (p[0] ** 2 + p[1] ** 2) / 2 - 1 / centres[0] - 1 / centres[1]

    def reflects(normal):
        def then(q, p):
            n = normal(q[0], q[1])
            k = 2 * (p[0] * n[0] + p[1] * n[1]) / (n[0] ** 2 + n[1] ** 2)
            return [q[0], q[1], p[0] - k * n[0], p[1] - k * n[1]]

        return then

    def outward(x, y):
        return 2 * x * (x - b) * (x - a) + (x - b) * (x * x + c) + (x - a) * (x * x + c), 2 * y

    events = [
        Event(
            lambda q: (q[0] - left) ** 2 + q[1] ** 2 - radius**2,
            direction=-1,
            then=reflects(lambda x, y: (x - left, y)),
            name="left",
        ),
        Event(
            lambda q: (q[0] - right) ** 2 + q[1] ** 2 - radius**2,
            direction=-1,
            then=reflects(lambda x, y: (x - right, y)),
            name="right",
        ),
        Event(
            lambda q: q[1] ** 2 - (a - q[0]) * (q[0] - b) * (q[0] ** 2 + c),
            direction=1,
            then=reflects(outward),
            name="wall",
        ),
    ]
    problem = Problem(Hamiltonian(energy, dof=2), q0=[0.0, 0.0], p0=[-1.0, 8.0], t_end=20.0)
    found = integrate(problem, HBVM(), [20.0], events=events)
    assert found.status is Status.FINISHED
    assert found.errors()["energy"].max() < 1e-12  # measured 3e-17


@pytest.mark.parametrize(
    "method",
    [HBVM(), HBVM(k=4, s=2, h=0.1), Gauss(s=4, h=0.25), HBVM(k=4, s=2, h=3.0)],
    ids=repr,
)
@pytest.mark.parametrize("restitution", [0.99, 0.9, 0.5, 0.1, 0.01, 1e-3, 1e-8])
def test_impacts_accumulate_where_intervals_shrink_to_nothing(method, restitution):
    # Before: some fell through the floor when this was first looked for by shrinking intervals alone.
    found = integrate(Problem(BALL, y0=[1.0, 0.0], t_end=400.0), method, [400.0], events=floor(restitution))
    limit = math.sqrt(2.0) * (1.0 + restitution) / (1.0 - restitution)
    assert found.status is Status.STALLED
    # Measured 1e-10 for the largest, at most 1e-12 below it, and 1e-8 for the smallest: rounding of the
    # height is much of its last flight.
    assert abs(found.t_stop - limit) < (1e-9 if restitution > 0.005 else 1e-6)


def test_two_balls_that_meet_the_floor_together_go_on():
    def fall(y):
        return [y[1], -1.0 + 0.0 * y[0], y[3], -1.0 + 0.0 * y[0], y[5], -1.0 + 0.0 * y[0]]

    def bounce(i):
        def then(y):
            return [y[j] if j != i + 1 else -y[j] for j in range(6)]

        return Event(lambda y: y[i], direction=-1, then=then, name=f"ball_{i}")

    heights = [1.0, 1.0 + 2e-16, 1.0 - 1e-16]
    start = [x for height in heights for x in (height, 0.0)]
    problem = Problem(VectorField(fall, dim=6), y0=start, t_end=40.0)
    for method in METHODS:
        found = integrate(problem, method, [40.0], events=[bounce(i) for i in (0, 2, 4)])
        assert found.status is Status.FINISHED
        assert [len(each.t) for each in found.events.values()] == [14, 14, 14]


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_start_on_a_wall_acts_where_it_moves_in_the_direction_of_the_event(method):
    # Before: a ball that was at exactly 0 and moved into the wall went through.
    for velocity, expected in ((-1.0, [10.0, 1.0]), (1.0, [10.0, 1.0])):
        problem = Problem(FLIGHT, y0=[0.0, velocity], t_end=10.0)
        found = integrate(problem, method, [10.0], events=floor(1.0))
        assert found.y[-1].tolist() == pytest.approx(expected)
        assert found.events["floor"].t.tolist() == ([0.0] if velocity < 0.0 else [])
    both = integrate(
        Problem(FLIGHT, y0=[0.0, 1.0], t_end=10.0), method, [10.0], events=floor(1.0, direction=0)
    )
    assert both.y[-1].tolist() == pytest.approx([10.0, 1.0])  # of no side is known that it is forbidden
    many = integrate_many(
        Problem(FLIGHT, y0=[0.0, 1.0], t_end=10.0),
        method,
        starts=[[0.0, -1.0], [0.0, 1.0], [1.0, -1.0]],
        times=[10.0],
        events=floor(1.0),
    )
    assert np.allclose(many.y[:, -1], [[10.0, 1.0], [10.0, 1.0], [9.0, 1.0]])


def test_a_ball_that_lies_on_the_floor_stays_there_and_one_that_is_lifted_leaves():
    lies = integrate(Problem(BALL, y0=[0.0, 0.0], t_end=1.0), HBVM(), [1.0], events=floor(0.5))
    assert lies.status is Status.STALLED
    assert lies.t_stop == 0.0
    lifted = VectorField(lambda y: [y[1], 1.0 + 0.0 * y[0]], dim=2)
    leaves = integrate(Problem(lifted, y0=[1.0, -3.0], t_end=4.0), HBVM(), [4.0], events=floor(0.0))
    first = 3.0 - math.sqrt(7.0)  # 1 - 3 t + t^2/2 = 0
    assert leaves.status is Status.FINISHED
    assert abs(leaves.y[-1, 0] - (4.0 - first) ** 2 / 2) < 1e-12  # measured 0
    stops = integrate(Problem(FLIGHT, y0=[1.0, -1.0], t_end=4.0), HBVM(), [4.0], events=floor(0.0))
    assert stops.status is Status.FINISHED
    assert np.abs(stops.y[-1]).max() < 1e-15


def test_a_terminal_event_ends_before_its_action_and_a_restart_acts():
    problem = Problem(FLIGHT, y0=[1.0, -1.0], t_end=3.0)
    found = integrate(problem, HBVM(), [3.0], events=floor(1.0, terminal=True))
    assert found.status is Status.EVENT
    assert found.y[-1].tolist() == pytest.approx([0.0, -1.0], abs=1e-15)
    assert np.array_equal(found.events["floor"].after, found.y[-1:])
    again = Problem(FLIGHT, y0=found.y[-1], t0=1.0, t_end=3.0)
    assert integrate(again, HBVM(), [3.0], events=floor(1.0)).y[-1].tolist() == pytest.approx([2.0, 1.0])
