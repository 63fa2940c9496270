"""Runs that go forward and backward over events, to times at which these happen, count each passage once.

The motion is y = r (cos(t + f), -sin(t + f)), so the events' times are known. Actions double r.
"""

import numpy as np
import pytest

import problems
from integrators import HBVM, Event, Gauss, Status, start

OSCILLATOR = problems.VectorField(lambda y: [y[1], -y[0]], dim=2)
METHODS = [
    HBVM(), HBVM(tol=1e-8), Gauss(s=5, tol=1e-10), HBVM(k=8, s=4, h=0.05), Gauss(s=4, h=0.11),
    HBVM(k=8, s=4, h=0.05, solver="newton"),
]  # fmt: skip
FUNCTIONS = {"q": lambda y: y[0], "p": lambda y: y[1]}
SAME = 1e-9  # times that close: the run stood at the event, which side of it depends on rounding


class Walk:
    """Events with known times, and a run that goes to and fro over them."""

    def __init__(self, seed):
        self.rng = rng = np.random.default_rng(seed)
        self.phase = rng.uniform(0.0, 2.0 * np.pi)
        self.kinds, self.events = [], []
        for i in range(rng.integers(1, 4)):
            kind, direction = str(rng.choice(list("tqp"))), int(rng.choice([0, 0, 1, -1]))
            place = float(rng.choice([rng.uniform(-6.0, 6.0), round(rng.uniform(-6.0, 6.0), 1)]))
            acts = rng.random() < 0.5
            g = (lambda t, place=place: t - place) if kind == "t" else FUNCTIONS[kind]
            then = (lambda y: [2 * y[0], 2 * y[1]]) if acts else None
            self.kinds.append((kind, place, direction, acts))
            self.events.append(Event(g, direction=direction, then=then, name=f"e{i}"))
        y0 = [np.cos(self.phase), -np.sin(self.phase)]
        problem = problems.Problem(OSCILLATOR, y0=y0, t_end=float(rng.choice([-10.0, 10.0])))
        self.run = start(problem, METHODS[rng.integers(len(METHODS))], self.events)
        self.stood = set()
        self.expected = [0] * len(self.kinds)

    def times(self, i):
        """Return the times of an event, and whether its function increases there with time."""
        kind, place, _, _ = self.kinds[i]
        if kind == "t":
            return [(place, 1)]
        turns = np.arange(-9, 9) * np.pi - self.phase + (np.pi / 2 if kind == "q" else 0.0)
        slope = np.sin if kind == "q" else np.cos
        return [(float(t), int(-np.sign(slope(t + self.phase)))) for t in turns]

    def goal(self):
        """Return a time to go to: any, or an event's, or the number beside it."""
        some = float(self.rng.uniform(-7.0, 7.0))
        where = self.rng.choice(["any", "event", "beside"])
        if where == "any":
            return some
        times = np.array([t for t, _ in self.times(self.rng.integers(len(self.kinds)))])
        t = float(times[np.argmin(abs(times - some))])
        return t if where == "event" else float(np.nextafter(t, self.rng.choice([-99.0, 99.0])))

    def go(self):
        """Go on by a step, to a time, or from a state that is set; keep what is to happen."""
        run, before = self.run, self.run.t
        what = self.rng.choice(["until", "until", "until", "step", "set"])
        if what == "until":
            run.until(self.goal())
        elif what == "step":
            run.step()
        else:
            run.y = run.y
        way = np.sign(run.t - before)
        for i, (_, _, direction, _) in enumerate(self.kinds):
            for t, slope in self.times(i):
                if min(abs(t - run.t), abs(t - before)) < SAME:
                    self.stood.add(i)
                elif way * (t - before) > 0.0 > way * (t - run.t) and direction in (0, way * slope):
                    self.expected[i] += 1


def check(seed):
    walk = Walk(seed)
    for _ in range(walk.rng.integers(2, 6)):
        walk.go()
        assert walk.run.status is Status.RUNNING, (seed, walk.run.reason)
    counts = [len(hits) for hits in walk.run.events.values()]
    for i, count in enumerate(counts):
        assert i in walk.stood or count == walk.expected[i], (seed, i, count, walk.expected[i])
    doublings = sum(count for count, kind in zip(counts, walk.kinds, strict=True) if kind[3])
    angle = walk.run.t + walk.phase
    there = 2.0**doublings * np.array([np.cos(angle), -np.sin(angle)])
    assert abs(walk.run.y - there).max() < 1e-10 * 2.0**doublings, seed  # measured 6e-13


@pytest.mark.parametrize("seed", range(40))
def test_every_passage_counts_once(seed):
    check(seed)


@pytest.mark.slow
def test_every_passage_counts_once_in_a_thousand_walks():
    for seed in range(40, 1000):  # before runs began anew where they turn, one in six failed
        check(seed)
