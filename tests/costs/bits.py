"""Digests of results, bit for bit: final states of the fifteen problems, all samples of some, ensembles."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

import problems
from integrators import HBVM, Gauss, integrate, integrate_many
from integrators.protocol import Status
from tests.costs.cases import CASES

RECORDED = Path(__file__).with_name("bits.json")
"""The digests, which ``python -m tests.costs.record`` rewrites."""

PROCESSORS = {"hires"}
"""Cases whose bits depend on the processor: Newton's method takes matrices from LAPACK, whose kernels differ.

Measured on 2026-11-25: Haswell's and SkylakeX's kernels of OpenBLAS give other digests, and other steps."""

SAMPLED = ("kepler", "outer_solar_system", "sitnikov", "double_pendulum", "lattice", "lorenz")
"""Cases of which `SAMPLES` states at equal distances are digested too, with `HBVM()`."""

SAMPLES = 30
STARTS, END = 24, 20.0  # of ensembles: more than one register holds, and not a multiple of 16

ENSEMBLES = {
    "kepler": (HBVM(), HBVM(tol=1e-6), Gauss(s=8, h=0.1)),
    "henon_heiles": (HBVM(), HBVM(k=8, s=4, h=0.5)),
    "pendulum": (HBVM(),),
    "double_pendulum": (HBVM(), HBVM(k=8, s=4, h=0.1)),
    "outer_solar_system": (HBVM(), Gauss(s=8, h=1.0)),
}
"""Problems of the catalogue and what integrates 24 neighbours of their start in lanes."""


def digest(states: np.ndarray) -> str:
    """Return the first 16 hexadecimal digits of the SHA-256 of an array's bytes."""
    return hashlib.sha256(np.ascontiguousarray(states, np.float64).tobytes()).hexdigest()[:16]


def alone(name: str) -> dict[str, str]:
    """Return the digests of a case's results, by method and by what is digested."""
    problem = CASES[name].problem()
    digests = {"start": digest(problem.y0)}
    for method in CASES[name].methods:
        digests[f"{method!r}, end"] = digest(integrate(problem, method, [problem.t_end]).y[-1])
    if name in SAMPLED:
        times = np.linspace(0.0, problem.t_end, SAMPLES)
        digests[f"{HBVM()!r}, {SAMPLES} samples"] = digest(integrate(problem, HBVM(), times).y)
    return digests


def in_lanes(name: str) -> dict[str, str]:
    """Return the digests of an ensemble's samples at five times, by method."""
    problem = problems.load(name, t_end=END)
    starts = problem.y0 * (1.0 + np.arange(STARTS)[:, None] / 1024.0)
    digests = {"starts": digest(starts)}
    for method in ENSEMBLES[name]:
        batch = integrate_many(problem, method, starts=starts, times=np.linspace(0.0, END, 5))
        assert set(batch.status) == {Status.FINISHED}, (name, method, batch.reason)
        digests[repr(method)] = digest(batch.y)
    return digests


def digested() -> dict[str, Any]:
    """Return all digests."""
    return {
        "alone": {name: alone(name) for name in CASES if name not in PROCESSORS},
        "in lanes": {name: in_lanes(name) for name in ENSEMBLES},
    }


def recorded() -> dict[str, Any]:
    """Return the digests on record."""
    return json.loads(RECORDED.read_text("utf-8"))
