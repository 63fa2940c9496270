"""Tables of faults as they are typed: a line is a piece of Python, a bar, and what the sentence says."""

import math
import re
from functools import partial
from typing import Any

import numpy as np

import integrators
import problems
from integrators import HBVM, Event, integrate, integrate_many, registry, section
from problems import Bodies, Hamiltonian, Opaque, Poisson, Problem, VectorField, load, targets

from .fault import Fault


def deep(x: Any, depth: int, m: Any) -> Any:
    """Return a function that calls itself."""
    return x if depth == 0 else m.sin(deep(x, depth - 1, m) + 0.1)


def horner(x: Any, degree: int) -> Any:
    """Return a polynomial as people write it."""
    return x if degree == 0 else horner(x, degree - 1) * x + 1


def osc(q: Any, p: Any) -> Any:
    """Return the energy of an oscillator."""
    return p[0] ** 2 / 2 + q[0] ** 2 / 2


def names() -> dict[str, Any]:
    """Return what the tables may use."""
    pendulum = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 - m.cos(q[0]), dof=1)
    spring = Hamiltonian(
        lambda q, p, par: p[0] ** 2 / 2 + par.mu * q[0] ** 2 / 2, dof=1, parameters={"mu": 1.0}, name="spring"
    )
    return {
        **{name: registry.get(name) for name in registry.names()},
        "nan": math.nan,
        "inf": math.inf,
        "huge": 10**400,
        "np": np,
        "math": math,
        "integrators": integrators,
        "problems": problems,
        "registry": registry,
        "targets": targets,
        "Event": Event,
        "integrate": integrate,
        "integrate_many": integrate_many,
        "section": section,
        "load": load,
        "Hamiltonian": Hamiltonian,
        "VectorField": VectorField,
        "Poisson": Poisson,
        "Opaque": Opaque,
        "Problem": Problem,
        "Bodies": Bodies,
        "deep": deep,
        "horner": horner,
        "osc": osc,
        "H1": pendulum,
        "V2": VectorField(lambda y: [y[1], -y[0]], dim=2),
        "K1": Problem(spring, y0=[1.0, 0.0], t_end=1.0),
        "P1": Problem(pendulum, q0=[0.0], p0=[1.9], t_end=1.0),
        "M1": HBVM(k=4, s=2, h=0.1),
        "F": lambda f: Problem(Opaque(f, dim=2), y0=[1, 2], t_end=1.0),
    }


def faults(table: str) -> list[Fault]:
    """Read a table."""
    known = names()
    rows = [line.rsplit(" | ", 1) for line in table.strip().splitlines() if line.strip()]
    return [
        Fault(code.strip(), partial(eval, code.strip(), known), re.escape(says.strip()))
        for code, says in rows
    ]
