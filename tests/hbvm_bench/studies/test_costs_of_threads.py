"""Two threads beside one and REBOUND: the same bits, and the page says what a thread saves."""

from functools import partial

import pytest

from hbvm_bench.measure.computation import packed, unpacked
from problems.errors import InputError
from tests.hbvm_bench.study_folders import module

threads = module("costs", "threads")


@pytest.mark.parametrize("name", threads.LARGE)
def test_a_quick_run_has_the_errors_of_both_numbers_of_threads_and_of_rebound(name):
    pytest.importorskip("rebound")
    found = threads.measured(name, 1, quick=True)
    for method in threads.LARGE[name].methods:
        assert found.position[f"1 {method}"] == found.position[f"2 {method}"]
    assert max(found.position.values()) < 1e-12  # measured: 3e-16
    assert max(found.energy.values()) < 1e-14  # measured: 4e-16
    assert unpacked(packed(found), partial(threads.measured, name, 1, quick=True)) == found
    rows = threads.table(name, found).rows
    assert [row[1] for row in rows] == ["1", "2", "1", "2", "1"]
    assert "relative to one is" in threads.sentence(name, found)


def test_other_bits_with_two_threads_are_an_error(monkeypatch):
    pytest.importorskip("rebound")
    whole = threads.integrate

    def wrong(problem, method, times, threads=1):
        made = whole(problem, method, times)
        made.y[-1, 0] += threads * 1e-15
        return made

    monkeypatch.setattr(threads, "integrate", wrong)
    with pytest.raises(InputError, match="another end with two threads"):
        threads.measured("chain", 1, quick=True)
