"""No integration that ends as finished, and without a warning, is wrong: 798 systems in nine classes."""

import pytest

from .pulsed import NARROW, STAIRCASE
from .table import SHAPES, search, table
from .ways import FAILED, SILENT

CASES = {
    "henon_heiles": 1, "duffing": 1, "kepler": 1, "driven": 1, "pole": 1, "contact": 2, "graze": 2,
    "gauss, at rest": 2, "power 21": 2, "t > par.c": 4, "t^2 > c": 2, "turning": 3,
    "dry friction": 2,
}  # fmt: skip
"""Formulas and cases of the fast test: 24 systems."""

FAILURES = 0.01  # part of the runs that may fail, by class


def report(found):
    return "\n".join([table(found), *(str(one) for one in found if one.verdict in (SILENT, FAILED))])


def needless(found):
    """Return the warnings on smooth systems, of which there is nothing to say."""
    return [one for one in found if one.warned and one.group.startswith("smooth")]


def test_a_few_systems_of_every_class_are_right_or_warn():
    found = search(shape.case(index) for shape in SHAPES for index in range(CASES.get(shape.name, 0)))
    assert not any(one.verdict in (SILENT, FAILED) for one in found), report(found)
    assert not needless(found)


GROUPS = list(dict.fromkeys(shape.group for shape in SHAPES))


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_nothing_is_silently_wrong(group):
    found = search(case for shape in SHAPES if shape.group == group for case in shape.cases())
    assert not needless(found)
    if group != NARROW:  # no node sees those; where an invariant shows them there is a warning
        assert not any(one.verdict == SILENT for one in found), report(found)
    # A field that rounding moves at first still fails between times, with a status: measured 6 of 215 runs.
    allowed = 4 * FAILURES if group == STAIRCASE else FAILURES
    assert sum(one.verdict == FAILED for one in found) <= allowed * len(found), report(found)


def test_there_are_four_hundred_systems():
    assert sum(shape.draws for shape in SHAPES if shape.group != NARROW) >= 400
