"""What the bench costs a peer: each is run through the harness, as campaigns time it, and alone.

This is no campaign: a campaign compares methods through the harness, and here the harness itself is compared
with a library that is called without it. The two take turns, round by round, in one process on one core, with
compiling and setting up outside both clocks. The result is a `hbvm_bench.summaries.peers.PeerCheck`;
``hbvm-bench doctor --peers --out`` keeps it.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import problems
from hbvm_bench.campaign.file import Ensemble
from hbvm_bench.campaign.identity import make_method
from hbvm_bench.measure import ensemble, machine
from hbvm_bench.measure.starts import members
from hbvm_bench.measure.timing import WARM_UP, Run, interleaved, no_collection
from hbvm_bench.run.worker import ENVIRONMENT, limit_and_die_with
from hbvm_bench.store.files import write_json
from hbvm_bench.studies.peers import alone as peers_alone
from hbvm_bench.studies.peers.alone import Script
from hbvm_bench.summaries.peers import PeerCheck, Row, digest
from integrators.protocol import Array, Status
from problems.errors import InputError
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian

ROUNDS = 15
STDERR = 2  # the file descriptor: what a library prints
CLOCK = time.process_time
"""The processor's time, in which other work on the machine does not count."""


@dataclass(frozen=True)
class Pair:
    """A method on a problem, and the script of its library alone.

    Attributes
    ----------
    problem : str
        A key of `PROBLEMS`.
    t_end : float
        Such that a run takes some tens of milliseconds, or as long as in the campaigns and the race.
    method : str
        As it is written on the command line.
    alone : callable
        From `hbvm_bench.studies.peers.alone`.
    call : str
        What it calls.
    share : float
        Of the span in which it takes some fifty steps and more: enough to see that they are the same.
    starts : int
        Of a batch; 0 for one trajectory.
    """

    problem: str
    t_end: float
    method: str
    alone: Callable[..., Script]
    call: str
    share: float = 0.02
    starts: int = 0


GEODESIC = "geodesic around a black hole"
KEPLER = "kepler(e=0.6)"
PLANETS = "outer_solar_system()"
HENON = "henon_heiles(energy=0.125, q2=0.1)"
LOOPS = "cr3bp(loops=4)"
UNTIL, INTEGRATE, SOLVE, IVP = "propagate_until", "sim.integrate", "diffeqsolve", "solve_ivp"
RACE = "Taylor(tol=1e-15)"

PAIRS = (
    Pair(KEPLER, 12000.0, "Taylor()", peers_alone.heyoka, UNTIL),
    Pair(KEPLER, 12000.0, "Taylor(compact_mode=True, high_accuracy=True)", peers_alone.heyoka, UNTIL),
    Pair(GEODESIC, 1500000.0, "Taylor()", peers_alone.heyoka, UNTIL),
    # the race's own spans, of 0.2 to 10 ms
    Pair(KEPLER, 3150.0, RACE, peers_alone.heyoka, UNTIL),
    Pair(HENON, 9600.0, RACE, peers_alone.heyoka, UNTIL),
    Pair(LOOPS, 0.0, RACE, peers_alone.heyoka, UNTIL, share=1.0),
    # the ensemble campaign's own count and span
    Pair(HENON, 96.0, "Taylor()", peers_alone.heyoka_batch, "taylor_adaptive_batch", 0.2, starts=10000),
    Pair(KEPLER, 1000.0, "IAS15()", peers_alone.rebound, INTEGRATE),
    Pair(PLANETS, 600.0, "IAS15()", peers_alone.rebound, INTEGRATE, share=0.3),
    Pair(KEPLER, 3000.0, "Leapfrog(h=0.01, order=4)", peers_alone.rebound, INTEGRATE, share=0.020033),
    Pair(PLANETS, 20000.0, "Leapfrog(h=0.1, order=4)", peers_alone.rebound, INTEGRATE, share=0.020033),
    Pair(PLANETS, 20000.0, "WHFast(h=0.3, corrector=17)", peers_alone.rebound, INTEGRATE),
    Pair(KEPLER, 30.0, "DOP853(rtol=1e-12, atol=1e-12)", peers_alone.scipy, IVP, share=1.0),
    Pair(KEPLER, 6.0, "Radau(rtol=1e-6, atol=1e-6)", peers_alone.scipy, IVP, share=1.0),
    Pair(KEPLER, 300.0, "Dopri8(rtol=1e-12, atol=1e-12)", peers_alone.diffrax, SOLVE, share=0.1),
    Pair(KEPLER, 60.0, "Dopri8(h=0.01)", peers_alone.diffrax, SOLVE),
    Pair(KEPLER, 15000.0, "ReversibleHeun(h=0.01)", peers_alone.diffrax, SOLVE),
    Pair(KEPLER, 15000.0, "LeapfrogMidpoint(h=0.01)", peers_alone.diffrax, SOLVE),
    Pair(KEPLER, 15000.0, "SemiImplicitEuler(h=0.01)", peers_alone.diffrax, SOLVE),
    Pair(PLANETS, 120000.0, "WHFast512(h=0.5)", peers_alone.rebound, INTEGRATE),
)


def geodesic(t_end: float) -> Problem:
    """Return a geodesic around a black hole of mass 1: H = g^ab p_a p_b / 2 in Schwarzschild's t, r, phi.

    It starts at its pericentre r = 10 with angular momentum 4; the orbit is bound, and H = -1/2.
    """

    def H(q: Any, p: Any) -> Any:
        f = 1 - 2 / q[1]
        return (f * p[1] ** 2 + p[2] ** 2 / q[1] ** 2 - p[0] ** 2 / f) / 2

    energy = np.sqrt(0.8 * 1.16)  # f (1 + L^2/r^2)
    system = Hamiltonian(H, dof=3, name="schwarzschild")
    return Problem(system, q0=[0.0, 10.0, 0.0], p0=[-energy, 0.0, 4.0], t_end=t_end)


PROBLEMS: dict[str, Callable[[float], Problem]] = {
    KEPLER: lambda t_end: problems.load("kepler", e=0.6, t_end=t_end),
    PLANETS: lambda t_end: problems.load("outer_solar_system", t_end=t_end),
    GEODESIC: geodesic,
    HENON: lambda t_end: problems.load("henon_heiles", energy=0.125, q2=0.1, t_end=t_end),
    LOOPS: lambda t_end: problems.load("cr3bp", loops=4),  # one period, its own span
}


def check(
    pairs: Sequence[Pair] = PAIRS,
    rounds: int = ROUNDS,
    short: bool = False,
    tell: Callable[[str], None] = print,
) -> PeerCheck:
    """Run every pair, with at least two rounds, and tell what is about to run.

    A short check takes only each pair's share of its span, and a few starts of a batch.
    """
    described = machine.describe(measure=True)
    rows: list[Row] = []
    refused: dict[str, str] = {}
    for pair in pairs:
        tell(f"{pair.method} on {pair.problem}")
        try:
            rows.append(_row(pair, rounds, short))
        except InputError as error:  # a missing library, or a processor that cannot
            refused[f"{pair.method} on {pair.problem}"] = str(error)
        except Exception as error:  # a peer may raise anything; what is measured is kept
            refused[f"{pair.method} on {pair.problem}"] = f"{type(error).__name__}: {error}"
    libraries = sorted({make_method(row.method).library for row in rows})
    return PeerCheck(
        rows=rows,
        refused=refused,
        machine=described,
        versions={name: version(name) for name in ("hbvm-bench", *libraries)},
        measured=datetime.now(UTC).isoformat(timespec="seconds"),
        sources=digest(row.method for row in rows),
    )


def _row(pair: Pair, rounds: int, short: bool) -> Row:
    problem = PROBLEMS[pair.problem](pair.t_end * (pair.share if short else 1.0))
    method, title = make_method(pair.method), pair.problem
    if reason := method.accepts(problem):
        raise InputError(reason)
    if pair.starts:
        count = min(pair.starts, 20) if short else pair.starts
        starts, title = members(problem, Ensemble(count=count, spread=0.01))[0], f"{title}, {count} starts"
        harness: Any = ensemble.EnsembleRun(method.compile(problem.system), starts, problem, method.to_end)
        script = pair.alone(problem, method, starts)
        made = ensemble.integrate(harness.program, starts, problem, harness.sample)
        steps, y, status = made.steps, made.y, max(made.status, key=lambda one: one is not Status.FINISHED)
    else:
        harness = Run.of(problem, method)
        script = pair.alone(problem, method)
        harness.until(WARM_UP).seconds()
        stepper = harness.program.start(harness.y0, harness.par, harness.t0)
        samples = stepper.advance(np.array([harness.t_end]), sample=harness.sample)
        steps, y, status = stepper.stats.steps, stepper.y, samples.status
    if status is not Status.FINISHED:
        raise InputError(f"{pair.method} ended as {status.value}")
    _, alone_steps, alone_y = _alone(script)  # its first run is not counted either
    seconds, alone = interleaved([lambda: harness.seconds(clock=CLOCK)[0], lambda: _alone(script)[0]], rounds)
    return Row(
        problem=title,
        method=repr(method),
        call=pair.call,
        seconds=seconds,
        alone=alone,
        steps=int(steps),
        alone_steps=int(alone_steps),
        difference=float(np.abs(y - alone_y).max() / np.abs(alone_y).max()),
    )


def _alone(script: Script) -> tuple[float, int, Array]:
    """Return seconds, steps and the end of one run of a library alone, garbage collection off as in `Run`."""
    run = script.begin()
    with no_collection():
        start = CLOCK()
        made = script.go(run)
        spent = CLOCK() - start
    return spent, *script.end(run, made)


def in_a_process(out: Path, rounds: int) -> int:
    """Run every pair in a process that has one thread for every library; return its exit code."""
    command = [sys.executable, "-m", __spec__.name, str(out), str(rounds)]
    environment = {**os.environ, **ENVIRONMENT}
    return subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=STDERR, env=environment, check=False
    ).returncode


def main(out: Path, rounds: int) -> None:
    """Write the result: deaf to Ctrl-C, gone with the parent, on one core."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    limit_and_die_with(os.getppid())
    os.sched_setaffinity(0, {machine.cores()[-1]})
    write_json(out, check(rounds=rounds, tell=lambda what: print(what, file=sys.stderr, flush=True)))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
