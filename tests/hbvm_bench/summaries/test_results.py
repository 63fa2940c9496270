"""Stored results are read from Python."""

import numpy as np
import pytest

from hbvm_bench.store.store import Store
from hbvm_bench.summaries.results import Results
from problems.errors import InputError
from tests.hbvm_bench import made_up_run


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    directory = tmp_path_factory.mktemp("run")
    made_up_run.write(Store(directory), ["kepler(e=0.5)"], 4)
    return directory


def test_a_frame_has_a_row_per_case_and_its_id_finds_the_arrays(run):
    results, store = Results(run), Store(run)
    cases = results.frame()
    assert cases.id.tolist() == [record.id for record in store.records()]
    stored = [number for number in cases.id if store.series(number)]
    assert stored
    for number in stored:
        arrays, known = results.arrays(number), store.series(number)
        assert {*arrays} == {*known}
        assert all(np.array_equal(arrays[name], known[name], equal_nan=True) for name in known)
    assert {*results.arrays(stored[0][:20])} == {*store.series(stored[0])}


def test_a_case_that_is_not_there_and_one_of_many_are_refused(run):
    results = Results(run)
    with pytest.raises(InputError, match="no case has an id that begins with 'nothing'"):
        results.arrays("nothing")
    with pytest.raises(InputError, match="cases have an id"):
        results.arrays("")
    with pytest.raises(InputError, match="table"):
        results.frame("rows")
    with pytest.raises(InputError, match="does not exist"):
        Results(run / "elsewhere")
