"""Gradients beside diffrax and heyoka: all have the same derivatives, and the page says who is fast."""

from functools import partial

import numpy as np
import pytest

from hbvm_bench.measure.computation import packed, unpacked
from integrators import Gauss
from tests.hbvm_bench.study_folders import module

gradients, Times = module("costs", "gradients"), module("costs", "experiments").Times
pytest.importorskip("heyoka")
pytest.importorskip("diffrax")


@pytest.mark.parametrize(
    "name", ["two oscillators", pytest.param("a neural network", marks=pytest.mark.slow)]
)
def test_derivatives_by_the_adjoint_by_tangent_vectors_and_by_heyoka_agree(name):
    problem = gradients.PROBLEMS[name]()
    ours = gradients.by_adjoint(problem, Gauss(s=8, h=0.25))
    for others in (gradients.by_variations(problem), gradients.by_heyoka(problem, 1e-15)()):
        assert np.abs(ours - others).max() / np.abs(ours).max() < 1e-13  # measured: 2.4e-15


@pytest.mark.slow
def test_all_settings_are_timed_and_have_the_same_derivatives():
    found = gradients.measured("two oscillators", 1)
    assert found.numbers == 8
    assert found.times.seconds.keys() == found.errors.keys()
    for key, error in found.errors.items():
        assert error < 1e-8, key  # measured: 7.6e-10 of diffrax, 4.1e-16 of ours
        assert error < 1e-12 or key.endswith("tol=1e-10"), key  # measured: 8.0e-13 of diffrax
    assert unpacked(packed(found), partial(gradients.measured, "two oscillators", 1)) == found
    assert len(gradients.table("two oscillators", found).rows) == len(found.errors)


def test_only_accurate_settings_are_compared():
    seconds = {gradients.OURS: [2.0, 2.0], "heyoka: loose": [0.1, 0.1], "diffrax: tight": [1.0, 1.0]}
    errors = dict(zip(seconds, (1e-16, 1e-3, 1e-12), strict=True))
    found = gradients.Gradients(Times(seconds, 0.0, 0.0), errors, 8)
    said = gradients.sentence("two oscillators", found)
    assert "diffrax is the fastest. Times relative to it: HBVM 2." in said
    assert "heyoka" not in said
    assert [row[4] for row in gradients.table("two oscillators", found).rows][1:] == [
        "0.05× (0.05–0.05)",
        "0.50× (0.50–0.50)",
    ]
