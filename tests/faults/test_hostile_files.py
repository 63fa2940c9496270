"""Files that can harm: `integrators.load` on what was changed by accident or on purpose."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hbvm_bench.store.files import spreadsheet_text
from integrators import Gauss, integrate, load
from problems import Hamiltonian, InputError, Problem
from problems.systems.hamiltonian import Hamiltonian as System

from . import hostile_files


def test_files_that_nobody_changed_are_loaded_after_everything_was_derived(tmp_path):
    for k, solution in enumerate(hostile_files.solutions()):
        solution.save(tmp_path / f"{k}.npz")
        found = load(tmp_path / f"{k}.npz")
        hostile_files.used(found, compile_it=False)
        assert np.array_equal(found.y, solution.y)
        assert found.problem == solution.problem


def test_changed_files_are_refused_or_stay_inside_their_arrays():
    assert 0 < hostile_files.attempts(20261122, 500) < 500  # measured: 55 are taken


@pytest.mark.slow
def test_ten_thousand_changed_files_end_no_process():
    folder = Path(__file__).parent
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "hostile_files.py", "7", "10000"],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert 100 < int(done.stdout) < 5000


def pendulum() -> Problem:
    system = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 - m.cos(q[0]), dof=1, name="pendulum")
    return Problem(system, q0=[0.1], p0=[0.0], t_end=1.0)


def changed(tmp_path, change):
    """Return the path of a solution's file whose words were changed by a function."""
    arrays = hostile_files.contents(integrate(pendulum(), Gauss(s=2, h=0.1), [1.0]))
    words = json.loads(arrays["words"].tobytes())
    change(words)
    arrays["words"] = np.frombuffer(json.dumps(words).encode(), dtype=np.uint8)
    np.savez(tmp_path / "changed.npz", **arrays)
    return tmp_path / "changed.npz"


def nodes(words):
    return words["problem"]["system"]["graph"]["nodes"]


def first(words, op):
    return next(node for node in nodes(words) if node[0] == op)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda w: first(w, "symbol")[2].__setitem__(1, 2**20), "the place of y is 1048576"),
        (lambda w: first(w, "symbol")[2].__setitem__(1, -1), "the place of y is -1"),
        (lambda w: first(w, "symbol").__setitem__(3, 0), "symbol depends on other things"),
        (lambda w: first(w, "symbol")[2].__setitem__(0, "out"), "no symbol 'out'"),
        (lambda w: first(w, "cos")[1].__setitem__(0, 10**6), "the number of an operation is 1000000"),
        (lambda w: first(w, "cos").__setitem__(0, "__import__"), "no operation '__import__'"),
        (lambda w: w["problem"]["system"].__setitem__("dim", 4), "dim=4"),
        (lambda w: w["problem"]["system"]["functions"]["hamiltonian"][0].append([]), "2 outputs"),
        (lambda w: w["problem"]["system"]["functions"].pop("hamiltonian"), "lacks a function"),
        (lambda w: w["problem"]["state"]["dict"].append(["__class__", 1]), "other parts"),
        (lambda w: w.__setitem__("t_stop", "soon"), "damaged"),
    ],
)  # fmt: skip
def test_what_points_outside_is_refused_by_one_sentence(tmp_path, change, says):
    with pytest.raises(InputError, match=says) as caught:
        load(changed(tmp_path, change))
    assert "\n" not in str(caught.value)


def test_what_a_file_says_commands_no_terminal(tmp_path):
    def change(words):
        words["reason"] = "\x1b]0;gone\x07\x1b[2J"
        words["problem"]["system"]["name"] = "\x1b[31mred"

    found = load(changed(tmp_path, change))
    assert isinstance(found.problem.system, System)
    for text in (str(found), repr(found), repr(found.problem)):
        assert not set(text) & {"\x1b", "\x07"}


def test_no_cell_of_a_table_is_a_formula():
    cells = ["=1+1", "+1", "-cmd", "@x", "\tx", "-1.5e-3", "+2", "text"]
    expected = ["'=1+1", "+1", "'-cmd", "'@x", "'\tx", "-1.5e-3", "+2", "text"]
    assert [spreadsheet_text(cell) for cell in cells] == expected
