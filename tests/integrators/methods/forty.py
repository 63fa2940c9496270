"""Forty systems, with the accuracy that `integrators.advise` is asked for on each; eighteen are chaotic.

They were chosen before `advise` looked at whole trajectories, and are not to be chosen by what it says.
``python -m tests.integrators.methods.forty`` writes their ends, forty.json: those of heyoka's Taylor method
with 113 bits, from the same doubles.
"""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

import problems
from hbvm_bench.reference.solutions import taylor
from problems import Hamiltonian, Problem, VectorField


def _bar(q, p, m):
    """Return the energy in the frame of a bar that turns, in a logarithmic potential."""
    log = m.log(0.01 + q[0] ** 2 + q[1] ** 2 / 0.64) / 2
    return (p[0] ** 2 + p[1] ** 2) / 2 - 0.7 * (q[0] * p[1] - q[1] * p[0]) + log


def _lorenz(y):
    return [10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 * y[2] / 3]


def _roessler(y):
    return [-y[1] - y[2], y[0] + y[1] / 5, 0.2 + y[2] * (y[0] - 5.7)]


def _driven_pendulum(t, y, m):
    return [y[1], -m.sin(y[0]) - y[1] / 20 + 1.2 * m.cos(2 * t / 3)]


def _duffing(t, y, m):
    return [y[1], y[0] - y[0] ** 3 - y[1] / 4 + 0.4 * m.cos(t)]


def _ring(y):
    """Return E. N. Lorenz' equations of 1996 on eight sites."""
    n = 8
    return [(y[(i + 1) % n] - y[i - 2]) * y[i - 1] - y[i] + 8 for i in range(n)]


def _abc(y, m):
    return [
        m.sin(y[2]) + 0.7 * m.cos(y[1]),
        0.8 * m.sin(y[0]) + m.cos(y[2]),
        0.7 * m.sin(y[1]) + 0.8 * m.cos(y[0]),
    ]


def _quartic(q, p):
    return (p[0] ** 2 + p[1] ** 2) / 2 + q[0] ** 2 * q[1] ** 2 / 2 + (q[0] ** 4 + q[1] ** 4) / 80


def _three_bodies(q, p, m):
    """Return the energy of three equal masses in a plane."""
    energy = 0.0
    for i in range(3):
        energy = energy + (p[2 * i] ** 2 + p[2 * i + 1] ** 2) / 2
        for j in range(i):
            x, y = q[2 * i] - q[2 * j], q[2 * i + 1] - q[2 * j + 1]
            energy = energy - 1 / m.sqrt(x**2 + y**2)
    return energy


def _forced(t, y, m):
    return [y[1], -y[0] + m.sin(2 * t)]


def _van_der_pol(y):
    return [y[1], 2 * (1 - y[0] ** 2) * y[1] - y[0]]


def _first_order(f, start, t_end):
    return Problem(VectorField(f, dim=len(start)), y0=start, t_end=t_end)


def _energy(H, q, p, t_end):
    return Problem(Hamiltonian(H, dof=len(q)), q0=q, p0=p, t_end=t_end)


CHAOTIC: dict[str, tuple[float, Callable[[], Problem]]] = {
    "pythagorean": (1e-4, lambda: problems.load("pythagorean")),
    "rotating bar": (1e-8, lambda: _energy(_bar, [0.3, 0.1], [0.1, 0.6], 300.0)),
    "Henon-Heiles, E = 1/6": (1e-8, lambda: problems.load("henon_heiles", t_end=300.0)),
    "Henon-Heiles, E = 1/8": (
        1e-6, lambda: problems.load("henon_heiles", energy=0.125, q2=-0.2, direction=0.4, t_end=500.0)
    ),
    "Lorenz": (1e-8, lambda: _first_order(_lorenz, [1.0, 2.0, 20.0], 60.0)),
    "Lorenz, a short while": (1e-6, lambda: _first_order(_lorenz, [1.0, 2.0, 20.0], 15.0)),
    "Roessler": (1e-8, lambda: _first_order(_roessler, [1.0, 2.0, 0.5], 300.0)),
    "double pendulum, over the top": (
        1e-8, lambda: problems.load("double_pendulum", q1=2.0, q2=2.5, t_end=100.0)
    ),
    "double pendulum": (1e-8, lambda: problems.load("double_pendulum", t_end=200.0)),
    "driven pendulum": (1e-8, lambda: _first_order(_driven_pendulum, [0.2, 0.0], 200.0)),
    "driven Duffing": (1e-6, lambda: _first_order(_duffing, [0.5, 0.1], 200.0)),
    "spring pendulum": (1e-8, lambda: problems.load("spring_pendulum", x=0.3, z=0.3, vy=0.4, t_end=100.0)),
    "quartic": (1e-8, lambda: _energy(_quartic, [1.0, 0.3], [0.2, 0.9], 150.0)),
    "Lorenz 1996": (1e-8, lambda: _first_order(_ring, [8.0] * 7 + [8.01], 30.0)),
    "ABC flow": (1e-8, lambda: _first_order(_abc, [0.3, 0.5, 1.1], 200.0)),
    "three bodies": (
        1e-6, lambda: _energy(_three_bodies, [1.0, 0.0, -0.6, 0.5, -0.4, -0.5],
                              [0.1, 0.5, -0.4, -0.3, 0.3, -0.2], 20.0)
    ),
    "cluster": (1e-8, lambda: problems.load("cluster", n=5, t_end=30.0)),
    "thermal chain": (
        1e-8,
        lambda: problems.load(
            "fput", n=8, alpha=0.0, beta=1.0, start="thermal", temperature=1.0, t_end=300.0
        ),
    ),
}  # fmt: skip

REGULAR: dict[str, tuple[float, Callable[[], Problem]]] = {
    "Kepler, e = 0.1": (1e-8, lambda: problems.load("kepler", e=0.1)),
    "Kepler, e = 0.6": (1e-10, lambda: problems.load("kepler")),
    "Kepler, e = 0.9": (1e-6, lambda: problems.load("kepler", e=0.9)),
    "Kepler, e = 0.99": (1e-8, lambda: problems.load("kepler", e=0.99, t_end=120.0)),
    "Kepler, too much": (1e-15, lambda: problems.load("kepler", e=0.3)),
    "pendulum": (1e-8, lambda: problems.load("pendulum")),
    "Morse": (1e-10, lambda: problems.load("morse")),
    "charged particle": (1e-8, lambda: problems.load("charged_particle", t_end=300.0)),
    "Penning trap": (1e-8, lambda: problems.load("penning_trap", t_end=200.0)),
    "Lotka-Volterra": (1e-8, lambda: problems.load("lotka_volterra")),
    "rigid body": (1e-10, lambda: problems.load("rigid_body")),
    "rigid body, quartic": (1e-8, lambda: problems.load("rigid_body", quartic=0.5)),
    "Toda": (1e-9, lambda: problems.load("toda", n=4)),
    "planets": (1e-6, lambda: problems.load("outer_solar_system", t_end=3000.0)),
    "figure eight": (1e-8, lambda: problems.load("figure_eight", t_end=60.0)),
    "stiff springs": (1e-6, lambda: problems.load("stiff_chain", t_end=30.0)),
    "period annulus": (1e-8, lambda: problems.load("period_annulus", t_end=300.0)),
    "Schwarzschild": (1e-8, lambda: problems.load("schwarzschild", t_end=2000.0)),
    "three bodies, restricted": (1e-6, lambda: problems.load("cr3bp")),
    "Sitnikov": (1e-8, lambda: problems.load("sitnikov", t_end=200.0)),
    "forced oscillator": (1e-9, lambda: _first_order(_forced, [1.0, 0.0], 100.0)),
    "van der Pol": (1e-8, lambda: _first_order(_van_der_pol, [2.0, 0.0], 100.0)),
}
SYSTEMS = CHAOTIC | REGULAR

FILE = Path(__file__).with_suffix(".json")
AGREE = 1e-4  # two tolerances, relative: measured at most 8e-6 (Lorenz), and the next 1.4e-7


def ends() -> dict[str, np.ndarray]:
    """Return the states at the ends."""
    return {
        name: np.array([float.fromhex(x) for x in end]) for name, end in json.loads(FILE.read_text()).items()
    }


def main() -> None:
    """Compute the ends with two tolerances, and write those of the smaller one."""
    found = {}
    for name, (_, make) in SYSTEMS.items():
        problem = make()
        times = np.array([problem.t0, problem.t_end])
        end, other = (np.array(taylor(problem, times, tol)[-1], dtype=float) for tol in ("1e-30", "1e-26"))
        if not np.abs(end - other).max() <= AGREE * np.abs(end).max():
            raise ValueError(f"{name}: two references differ")
        found[name] = [x.hex() for x in end.tolist()]
    FILE.write_text(json.dumps(found, indent=0) + "\n")


if __name__ == "__main__":
    main()
