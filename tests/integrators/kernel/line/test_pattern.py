"""The equations of several invariants have the sparsity of what they are about."""

import numpy as np
import pytest

import problems
from integrators.kernel.line.pattern import Pattern
from problems import Constrained


def pattern_of(system):
    return Pattern.of(system, [system.slopes(name) for name in system.invariants])


def chain(n):
    def rod(i):
        def length(q):
            ends = [(q[2 * i + c], q[2 * i - 2 + c] if i else 0.0) for c in range(2)]
            return sum((a - b) ** 2 for a, b in ends) - 1

        return length

    def H(q, p):
        return sum(p[i] ** 2 for i in range(2 * n)) / 2 + sum(q[2 * i + 1] for i in range(n))

    return Constrained(H, constraints=[rod(i) for i in range(n)], dof=2 * n)


def test_products_and_factors_of_a_chain_grow_with_its_length():
    sizes = np.array(
        [[len(pattern_of(chain(n)).tables[name]) for name in ("row_a", "lower_column")] for n in (10, 20, 40)]
    )
    growth = sizes[1:] / sizes[:-1]
    assert np.all(growth < 2.1)  # measured 2.06; dense matrices: 8 and 4


@pytest.mark.parametrize("name", ["kepler", "sitnikov", "toda", "rigid_body"])
def test_every_entry_of_the_gradients_is_in_the_pattern(name):
    from problems import targets

    problem = problems.load(name)
    system, random = problem.system, np.random.default_rng(0)
    scalars = [scalar for key in system.invariants for scalar in system.components(key).values()]
    gradients = [system.gradient(scalar) for scalar in scalars]
    pattern = pattern_of(system)
    y = problem.y0 + 0.1 * random.standard_normal(problem.y0.size)
    slopes = [system.slopes(name).function for name in system.invariants]
    entries = [targets.numpy(system, function)(0.0, y, problem.par) for function in slopes]
    whole = [targets.numpy(system, gradient)(0.0, y, problem.par) for gradient in gradients]
    assert np.array_equal(pattern.gradients(np.concatenate(entries)), np.array(whole))
