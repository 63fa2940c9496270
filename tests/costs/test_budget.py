"""What the budget counts is what an emitted function does."""

import pytest

import problems
from problems import targets
from tests.hbvm_bench.study_folders import module

budget = module("costs", "budget")


def test_the_operations_of_a_field_are_counted_without_those_of_parameters():
    found = budget.operations(
        "def f(t, y, par, out):\n  c = 2.0*par[0]\n  v = c*y[0] + y[1]\n  out[0] = -sqrt(v)\n"
    )
    assert found == {"*": 1, "+": 1, "sqrt": 1}


def test_a_loop_counts_as_often_as_it_runs():
    chain = problems.load("fput", n=100)
    found = budget.operations(targets.source(chain.system, "force", "numba").text)
    body = "def f(t, y, par, out):\n  for k in range(2, 12, 2):\n    out[k] = y[k]*y[k]\n"
    assert budget.operations(body) == {"*": 5}
    assert found["*"] > 99 * 4


def test_the_pairs_of_six_bodies_have_a_division_and_a_square_root_each():
    system = problems.load("outer_solar_system").system
    found = budget.operations(targets.source(system, "force", "numba").text)
    assert (found["/"], found["sqrt"]) == (15, 15)


def test_the_machine_code_of_a_field_takes_all_its_roots_at_once():
    system = problems.load("kepler").system
    text = budget.assembly(system, "force", 8)
    assert "hbvm_entry" in text
    assert 1 <= text.count("sqrtpd") <= 4  # one instruction for 8, 4 or 2 lanes
    assert "sqrtsd" not in text


def test_the_command_prints_counts_and_times(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["budget", "kepler", "--k", "4", "--s", "4", "--h", "0.05"])
    monkeypatch.setattr(budget, "ROUNDS", 1)
    budget.main()
    printed = capsys.readouterr().out
    assert "second-order form, 2 rows, 8 lanes" in printed
    assert "8 sqrt" in printed
    assert "ns per iteration" in printed


@pytest.mark.parametrize("name", ["no_such_problem"])
def test_an_unknown_problem_ends_with_code_2(monkeypatch, capsys, name):
    monkeypatch.setattr("sys.argv", ["budget", name])
    with pytest.raises(SystemExit) as ended:
        budget.main()
    assert ended.value.code == 2
    assert name in capsys.readouterr().err
