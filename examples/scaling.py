"""How an ensemble scales with this machine's cores: `integrate_many` with 1, 2, 4, ... threads."""

import argparse
from datetime import date
from statistics import median
from time import perf_counter

import numpy as np

import integrators
import problems
from hbvm_bench.measure import machine


def counts(cores: int) -> list[int]:
    """Return the powers of two up to the number of cores, and that number."""
    return sorted({2**i for i in range(cores.bit_length())} | {cores})


def seconds(threads: int, starts: np.ndarray, t_end: float, rounds: int) -> float:
    """Return the median time of an ensemble of Hénon-Heiles orbits."""
    problem, method = problems.load("henon_heiles"), integrators.Gauss(s=8, h=0.5)
    taken = []
    for _ in range(rounds + 1):  # the first one compiles
        begin = perf_counter()
        made = integrators.integrate_many(problem, method, starts=starts, times=[t_end], threads=threads)
        taken.append(perf_counter() - begin)
        assert made.arrived.all()
    return median(taken[1:])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trajectories", type=int, default=20_000)
    parser.add_argument("--t-end", type=float, default=100.0)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    cores = len(machine.cores())
    spread = np.linspace(0.9, 1.0, given.trajectories)[:, np.newaxis]
    starts = problems.load("henon_heiles").y0 * spread
    print(f"{machine.sentence(machine.describe(measure=True))} {cores} cores, {date.today().isoformat()}.\n")
    print(f"{given.trajectories} Hénon-Heiles orbits to t = {given.t_end:g}, Gauss(s=8, h=0.5):\n")
    print("| threads | time (s) | speed-up | efficiency |\n|--:|--:|--:|--:|")
    first = None
    for threads in counts(cores):
        taken = seconds(threads, starts, given.t_end, given.rounds)
        first = first or taken
        print(
            f"| {threads} | {taken:.3g} | {first / taken:.2f} | {first / taken / threads:.0%} |", flush=True
        )


if __name__ == "__main__":
    main()
