"""What the paper says of the methods themselves, one sentence per test."""

import pytest

from hbvm_bench.studies.paper.experiments import properties
from hbvm_bench.studies.paper.experiments.properties import PAIRS


@pytest.fixture(scope="module")
def conserved():
    return {nu: properties.conservation(nu) for nu in (3, 5)}


def test_the_order_is_2s_for_every_k():
    for row in properties.orders():
        assert row.slope == pytest.approx(2 * row.s, abs=0.12), row  # within 0.05


def test_the_methods_are_symmetric():
    for method, back in properties.reversals():
        assert back < 1e-13, method  # 6.7e-15 at most


def test_the_methods_are_perfectly_a_stable():
    edge, inside = properties.stability()
    assert edge < 1e-12  # 2.2e-14
    assert inside < 1.0  # 1 - 8e-11 close to the imaginary axis


def test_for_k_equal_s_it_is_the_gauss_method():
    assert properties.collocation_gap() < 1e-14  # 3.8e-16
    assert properties.same_bits()


@pytest.mark.parametrize("degree", [3, 5])
def test_polynomial_energies_are_conserved_from_the_threshold_on(conserved, degree):
    for s, k, error in conserved[degree]:
        if 2 * k >= degree * s:
            assert error < 1e-13, (k, s)  # 4.7e-15 at most
        elif s <= 3:
            assert error > 1e-11, (k, s)  # 2.2e-10 at least: the threshold is sharp


def test_the_block_size_is_s_whatever_k():
    assert properties.ranks() == [s for _, s in PAIRS]
    counts = [count for _, count in properties.iterations()]
    assert max(counts) < 1.15 * min(counts)  # 12.2 to 12.6


def test_the_extended_collocation_conditions_hold_from_the_threshold_on():
    for k, s, residual in properties.extended():
        if 2 * k >= 5 * s:
            assert residual < 5e-14, (k, s)  # 5.3e-15 at most
        else:
            assert residual > 1e-10, (k, s)  # 9.1e-9 at least


def test_gauss_is_symplectic_and_hbvm_is_not():
    for method, defect in properties.defects():
        if method.startswith("Gauss"):
            assert defect < 1e-11, method  # 7.3e-14
        else:
            assert defect > 1e-6, method  # 2.5e-5 at least
