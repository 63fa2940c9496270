"""The emitted field against the engines' own differentiation of the user's function."""

from typing import Any

import numpy as np
import pytest

from problems import targets

EPS = 2.0**-52
jax = pytest.importorskip("jax")
hy = pytest.importorskip("heyoka")


class Functions:
    """A library's functions as m."""

    def __init__(self, library: Any) -> None:
        self._library = library

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library, name)

    def sum(self, term: Any, index: Any) -> Any:
        return sum(term(*(i if isinstance(i, tuple) else (i,))) for i in index)


class Values:
    """The parameters' default values as par."""

    def __init__(self, system: Any) -> None:
        self.__dict__.update(system.parameters)


def energy(case: Any, q: Any, p: Any, library: Any) -> Any:
    names = case.function.__code__.co_varnames[: case.function.__code__.co_argcount]
    offered = {"q": q, "p": p, "par": Values(case.system), "m": Functions(library)}
    return case.function(*(offered[name] for name in names))


@pytest.mark.parametrize(
    "name",
    [
        "kepler",
        "double_pendulum",
        "magnetic",
        "zoo",
        "quartic",
        "ring",
        "lennard_jones",
        "mean_field",
        "sitnikov",
    ],
)
def test_fields_agree_with_the_gradients_of_jax_and_heyoka(cases: dict[str, Any], name: str):
    case = cases[name]
    system, par = case.system, case.system.pack()
    dof = system.dof
    rng = np.random.default_rng(20261121)
    states = rng.uniform(-2.0, 2.0, (5, system.dim))
    expected = targets.numpy(system, "field")(0.0, states.T, par).T
    scale = np.repeat(np.abs(expected).reshape(5, 2, dof).max(axis=2), dof, axis=1)

    jax.config.update("jax_enable_x64", True)
    slope = jax.grad(lambda y: energy(case, y[:dof], y[dof:], jax.numpy))
    found = np.stack([np.asarray(slope(jax.numpy.asarray(state))) for state in states])
    field = np.concatenate([found[:, dof:], -found[:, :dof]], axis=1)
    # Measured: 7.6 (zoo, by cancellation), else at most 1.6.
    assert (np.abs(field - expected) / (EPS * scale)).max() <= 16

    if name == "zoo":
        return  # heyoka has no abs
    q, p = (list(hy.make_vars(*(f"{x}{i:02d}" for i in range(dof)))) for x in "qp")
    pairs = hy.hamiltonian(energy(case, q, p, hy), q, p)
    own = hy.cfunc([rhs for _, rhs in pairs], [variable for variable, _ in pairs])
    field = np.stack([own(state) for state in states])
    # Measured: 4.7 (lennard_jones: 14th powers of rounded distances), else at most 1.7.
    assert (np.abs(field - expected) / (EPS * scale)).max() <= 16
