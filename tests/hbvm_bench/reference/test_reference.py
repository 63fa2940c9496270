import msgspec
import numpy as np
import pytest

import problems
from hbvm_bench.campaign.own import Known
from hbvm_bench.reference import solutions, trusted
from hbvm_bench.store.store import Store
from integrators.extended import arithmetic
from problems import targets
from problems.errors import InputError

Z_END = "-0.21429082377414021577602211142057"


def test_every_stored_reference_belongs_to_a_problem_and_starts_where_it_starts():
    for path in solutions.folder().glob("*.json"):
        stored = msgspec.json.decode(path.read_bytes(), type=solutions.ReferenceFile)
        name = stored.problem.partition("(")[0]
        assert name in problems.names()
        start = [float.fromhex(text) for text in stored.start]
        assert start == [float.fromhex(stored.t[0]), *(float(value) for value in stored.y[0])]
        assert "check" in stored.provenance
        # the file is what its encoder writes, so that recomputing it gives no other difference
        assert solutions.encode(stored) == path.read_text()


def test_sitnikov_has_the_value_that_was_computed_twice():
    problem = problems.load("sitnikov")
    stored = solutions.find_file(problem)
    assert stored is not None
    assert stored.y[-1][8].startswith(Z_END)
    # measured with tol 1e-30 instead of 1e-28: z agrees to 1e-21, x1 to 4e-24
    assert stored.y[-1][0].startswith("-2.4241362715986335486617150")
    assert [float.fromhex(t) for t in stored.t] == [25.0 * n for n in range(61)]


def test_the_planetoid_of_the_reference_stays_on_the_axis():
    known = solutions.find(problems.load("sitnikov"))
    assert known is not None
    assert np.all(known.high[:, 6:8] == 0)
    assert np.all(known.low[:, 6:8] == 0)


def test_two_doubles_hold_more_than_one(tmp_path):
    known = solutions.find(problems.load("sitnikov"))
    assert known is not None
    assert 0 < np.max(np.abs(known.low[1:])) < 2.0**-52


@pytest.mark.parametrize("arguments", [{"e": 0.6}, {"z3": 2e-9}, {"m3": 2e-5}])
def test_another_start_has_no_reference(arguments):
    assert solutions.find(problems.load("sitnikov", **arguments)) is None


def test_a_shorter_span_has_the_same_reference():
    assert solutions.find(problems.load("sitnikov", t_end=100.0)) is not None


def test_recomputing_a_short_span_gives_the_stored_digits():
    pytest.importorskip("heyoka")
    problem = problems.load("sitnikov", t_end=25.0)
    stored = solutions.find_file(problem)
    assert stored is not None
    cut = msgspec.structs.replace(stored, t=stored.t[:2], y=stored.y[:2])
    states = solutions.taylor(problem, np.array([0.0, 25.0]), solutions.TOLERANCE)
    fresh = msgspec.structs.replace(cut, y=[[str(value) for value in state] for state in states])
    # measured 2.4e-29: the two runs take different steps to their first output
    assert solutions.difference(cut, fresh) < 1e-26


def test_references_of_different_problems_are_not_compared():
    stored = solutions.find_file(problems.load("sitnikov"))
    assert stored is not None
    with pytest.raises(InputError, match="different problems"):
        solutions.difference(stored, msgspec.structs.replace(stored, t=stored.t[:-1]))


def test_of_several_references_the_one_that_has_the_end_time_is_found():
    short, long = problems.load("sitnikov"), problems.load("sitnikov", t_end=6000.0)
    assert solutions.find(short).t[-1] == 1500.0
    assert solutions.find(long).t[-1] == 6000.0
    assert solutions.find(problems.load("sitnikov", t_end=1.0)).t[-1] == 1500.0
    assert solutions.find(problems.load("solar_system", t_end=1e4)).t[-1] == 1e4


def test_over_a_long_interval_less_agreement_may_be_asked_for():
    pytest.importorskip("heyoka")
    problem = problems.load("kepler", e=0.6, t_end=6.0)
    made = trusted.make(problem, agreement=1e-10)
    assert "longdouble" in made.provenance["method"]
    assert made.provenance["check"] == "Gauss(s=8, tol=1e-14) in doubles"
    assert float(made.provenance["agreement"].split(" ")[0]) < 1e-14  # measured 3.8e-16
    assert made.condition == []


def test_a_run_does_not_know_the_reference_of_another_run(tmp_path):
    problem = problems.load("pendulum", q=0.3, t_end=7.0)
    given = {}
    for name, end in (("one", [0.1, 0.2]), ("other", [0.3, 0.4])):
        given[name] = solutions.of_end(problem, end)
        store = Store(tmp_path / name)
        store.prepare()
        store.keep(repr(problem), Known(references={given[name].key: given[name]}))
    none = Store(tmp_path / "none")
    none.prepare()
    for store, expected in ((Store(tmp_path / "one"), given["one"]), (none, None)):
        assert solutions.find_file(problem, store.known().references) == expected


def test_a_rounded_number_is_rounded_in_more_digits_too():
    system = problems.VectorField(lambda y, m: [y[0] - m.round(y[0])], dim=1)
    made = targets.source(system, "field", "numba")
    out = np.zeros(1, complex)
    arithmetic.compiled(made.text, made.name)(0.0, np.array([2.75 + 1e-17j]), np.empty(0, complex), out)
    assert out[0] == -0.25 + 1e-17j  # by the doubles' text it would be 0
