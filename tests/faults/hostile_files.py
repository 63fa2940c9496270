"""Files of solutions with something changed in them: what `load` must refuse, or make usable.

As a script, ``python hostile_files.py SEED N``, it tries many: a test then sees a crash of the process.
"""

import io
import json
import math
import random
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

import problems
from integrators import HBVM, Gauss, integrate, load
from integrators.solution import Solution
from problems import Hamiltonian, InputError, Lagrangian, Poisson, Problem, VectorField, targets
from problems.systems.base import Bodies, System
from problems.targets import called

KNOTS, VALUES = [-2.0, -1.0, 0.3, 1.0, 2.0], [0.0, 1.0, -0.5, 0.2, 0.7]
PAIRS = [(0, 3), (2, 1), (3, 0), (1, 1), (0, 2), (3, 2), (2, 0), (1, 3)]
HUGE = (-1, -2, 3, 17, 2**20, 2**31, 2**62, 2**70, -(2**62), 0.5, math.nan, math.inf, 1e308)
ODD = (None, True, "", "y", "out", "captured", "\x1b[2J", "a" * 5000, [], [[]], {}, {"tuple": []}, [1, 2, 3])


def solutions() -> list[Solution]:
    """Return solutions of systems of every kind, with loops, tables, parameters, events, bodies."""

    def loops(q, p, par, m):
        coupling = m.sum(lambda i, j: par.w[i] * m.table(q[i], KNOTS, VALUES) * q[j] ** 3, PAIRS)
        return m.sum(lambda i: p[i] ** 2 / 2 + (i + 1) * q[i] ** 4, range(4)) + coupling

    def swing(q, v, m):
        return v[0] ** 2 / 2 + v[1] ** 2 * (2 + m.cos(q[0])) / 2 + m.cos(q[1])

    def rotor(y):
        return y[0] ** 2 / 2 + y[1] ** 2 / 4 + y[2] ** 2 / 6

    def structure(y):
        return [[0, y[2], -y[1]], [-y[2], 0, y[0]], [y[1], -y[0], 0]]

    def gravity(q, p, par, m):
        r = m.sqrt((q[0] - q[3]) ** 2 + (q[1] - q[4]) ** 2 + (q[2] - q[5]) ** 2)
        kinetic = m.sum(lambda i: (p[3 * i] ** 2 + p[3 * i + 1] ** 2) / (2 * par.m[i]), range(2))
        return kinetic - par.m[0] * par.m[1] / r

    bodies = Hamiltonian(gravity, dof=6, parameters={"m": [1.0, 0.5]}, bodies=Bodies("m"))
    chain = Hamiltonian(
        loops, dof=4, parameters={"w": [1.0, 0.5, 0.2, 0.1]}, invariants={"n": lambda q: q[0]}
    )
    field = VectorField(lambda t, y, m: [y[1], -m.sin(y[0]) + m.where(t > 0.2, 1.0, y[2]), y[0]], dim=3)
    starts = [
        Problem(chain, q0=[0.1, 0.2, -0.3, 0.4], p0=[0.0] * 4, t_end=0.1),
        Problem(Lagrangian(swing, dof=2), q0=[0.1, 0.2], v0=[0.3, 0.4], t_end=0.1),
        Problem(Poisson(rotor, structure, dim=3), y0=[0.1, 0.2, 0.3], t_end=0.1, notes="of a top"),
        Problem(field, y0=[0.1, 0.2, 0.3], t_end=0.1, times=[0.05, 0.1]),
        Problem(bodies, q0=[0, 0, 0, 1, 0, 0], p0=[0, 0, 0, 0, 0.5, 0], t_end=0.1),
        problems.load("kepler", e=0.6),
    ]
    methods = [Gauss(s=2, h=0.05), HBVM(k=4, s=2, h=0.05)]
    made = [integrate(start, methods[i % 2], [0.05, 0.1]) for i, start in enumerate(starts)]
    for solution in made:
        solution.problem.system.jacobian()
    return made


def contents(solution: Solution) -> dict[str, np.ndarray]:
    """Return the arrays of a solution's file."""
    path = Path(tempfile.mkdtemp()) / "solution.npz"
    solution.save(path)
    with np.load(path) as file:
        found = {name: file[name] for name in file.files}
    path.unlink()
    path.parent.rmdir()
    return found


def places(value: Any) -> list[tuple[Any, Any]]:
    """Return every container with a key of it, in nested lists and dictionaries."""
    found: list[tuple[Any, Any]] = []
    keys = value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        found += [(value, key), *places(value[key])]
    return found


def mutated(arrays: dict[str, np.ndarray], r: random.Random) -> bytes:
    """Return the file with a few changes: of numbers, words, lists, arrays, or of its bytes."""
    words = json.loads(arrays["words"].tobytes())
    others = {name: array for name, array in arrays.items() if name != "words"}
    kind = r.random()
    if kind < 0.85:
        graph = words["problem"]["system"]
        for _ in range(r.choice((1, 1, 1, 2, 4))):
            container, key = r.choice(places(graph if r.random() < 0.7 else words))
            old = container[key]
            if type(old) is int and r.random() < 0.7:
                container[key] = old + r.choice((-3, -1, 1, 2, 7, 1000))
            elif isinstance(container, list) and r.random() < 0.3:
                r.choice((container.pop, lambda k, c=container: c.insert(k, r.choice(c))))(key)
            else:
                container[key] = r.choice((*HUGE, *ODD))
    elif kind < 0.95:
        name = r.choice(list(others))
        old = others[name]
        others[name] = r.choice((
            old[:-1], old.astype(np.int32), old.astype(">f8"), old.astype("U9"), old.reshape(-1, 1),
            old * np.nan, np.asfortranarray(old), np.concatenate([old, old]), old.ravel(), np.array(0.0),
            old.astype(complex),
        ))  # fmt: skip
    stream = io.BytesIO()
    np.savez(stream, words=np.frombuffer(json.dumps(words).encode(), dtype=np.uint8), **others)
    content = bytearray(stream.getvalue())
    if kind >= 0.95:
        for _ in range(r.randint(1, 8)):
            content[r.randrange(len(content))] = r.randrange(256)
    return bytes(content)


class Guarded:
    """An array that refuses every index outside of it, as compiled code does not."""

    def __init__(self, values: np.ndarray) -> None:
        self.values, self.shape = values, values.shape

    def _inside(self, i: Any) -> Any:
        places = i if isinstance(i, tuple) else (i,)
        assert len(places) == self.values.ndim
        for k, n in zip(places, self.values.shape, strict=True):
            assert isinstance(k, int | np.integer), f"{k!r} is no index"
            assert 0 <= k < n, f"index {k} of {n}"
        return i

    def __getitem__(self, i: Any) -> Any:
        return self.values[self._inside(i)]

    def __setitem__(self, i: Any, value: Any) -> None:
        self.values[self._inside(i)] = value


class _Numpy:
    int64 = np.int64

    @staticmethod
    def array(values: Any, dtype: Any = np.float64) -> Guarded:
        return Guarded(np.array(values, dtype=dtype))


def guarded(system: System, what: Any, par: np.ndarray) -> None:
    """Run what would be compiled, with every index checked."""
    for limit in (0, targets.SMALL):
        made = targets.source(system, what, "numba", limit=limit)
        namespace = {**vars(math), **vars(called), "np": _Numpy, "room": lambda _, n: Guarded(np.empty(n))}
        exec(made.text, namespace)  # noqa: S102 -- the text under test
        n = len(getattr(what, "function", what).outputs)
        with (
            np.errstate(all="ignore"),
            suppress(ArithmeticError, ValueError),
        ):  # a pole or a root of a negative number: nan in numba
            namespace[made.name](0.3, Guarded(np.full(system.dim, 0.3)), Guarded(par), Guarded(np.empty(n)))


def used(solution: Solution, *, compile_it: bool) -> None:
    """Do with a solution what anybody may do with it."""
    system, par = solution.problem.system, solution.problem.par
    assert solution.problem.y0.dtype == par.dtype == solution.y.dtype == np.float64
    assert solution.problem.y0.shape == (system.dim,) == solution.y.shape[1:]
    assert par.shape == (system.n_par,)
    for what in [*system.functions, system.jacobian()]:
        if what is not None:
            guarded(system, what, par)
    assert "\x1b" not in repr(solution) + str(solution)
    if compile_it:
        solution.errors()
        integrate(solution.problem, solution.method, [solution.problem.t0, solution.problem.t0 + 1e-3])


def attempt(content: bytes, path: Path, *, compile_it: bool = False) -> bool:
    """Load a file and use what is in it; return whether it was taken."""
    path.write_bytes(content)
    try:
        found = load(path)
    except InputError as error:
        if len(str(error)) > 1000:
            raise AssertionError(str(error)) from error
        return False
    with suppress(InputError):  # a formula that is too large to be compiled, an engine that does not take it
        used(found, compile_it=compile_it)
    return True


def attempts(seed: int, n: int, *, compile_every: int = 0) -> int:
    """Try n files; return how many were taken."""
    r, taken = random.Random(seed), 0
    files = [contents(solution) for solution in solutions()]
    path = Path(tempfile.mkdtemp()) / "hostile.npz"
    for k in range(n):
        content = mutated(r.choice(files), r)
        taken += attempt(content, path, compile_it=bool(compile_every) and k % compile_every == 0)
    path.unlink()
    path.parent.rmdir()
    return taken


if __name__ == "__main__":
    print(attempts(int(sys.argv[1]), int(sys.argv[2]), compile_every=100))
