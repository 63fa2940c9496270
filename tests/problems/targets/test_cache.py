"""Generated source in files, found again by other processes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from problems import InputError
from problems.targets import cache

SOURCE = "ANSWER = 42\n"


@pytest.fixture(scope="module", autouse=True)
def _own_folder(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HBVM_BENCH_CACHE", str(tmp_path_factory.mktemp("generated")))
        yield


def test_the_same_text_is_the_same_module():
    first = cache.module(SOURCE, "answer")
    assert first.ANSWER == 42
    assert cache.module(SOURCE, "answer") is first
    other = cache.module("ANSWER = 43\n", "answer")
    assert other.ANSWER == 43
    assert other.__name__ != first.__name__


def test_modules_can_be_imported_by_name_as_pickles_need():
    made = cache.module(SOURCE, "answer")
    assert sys.modules[made.__name__] is made
    assert made.__file__ is not None
    assert Path(made.__file__).stem == made.__name__
    assert not list(cache.directory().glob("*.tmp"))


def test_a_damaged_file_is_written_anew():
    text = "ANSWER = 44\n"
    made = cache.module(text, "damaged")
    assert made.__file__ is not None
    Path(made.__file__).write_text("ANSWER = 0\n")
    del sys.modules[made.__name__]
    assert cache.module(text, "damaged").ANSWER == 44


def test_a_module_that_fails_is_not_kept():
    with pytest.raises(ZeroDivisionError):
        cache.module("1/0\n", "broken")
    assert not [name for name in sys.modules if name.startswith("broken_")]


def test_a_folder_that_cannot_be_written_is_refused_by_name(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("HBVM_BENCH_CACHE", str(blocked / "below"))
    with pytest.raises(InputError, match=r"HBVM_BENCH_CACHE=.*below is not a folder that can be written"):
        cache.directory()


def test_the_folder_follows_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("HBVM_BENCH_CACHE", str(tmp_path / "own"))
    assert cache.directory() == tmp_path / "own"
    monkeypatch.delenv("HBVM_BENCH_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache.directory() == tmp_path / "xdg" / "hbvm-bench"


def test_without_a_home_each_process_has_a_folder_of_its_own(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.delenv("HBVM_BENCH_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert cache.directory().is_dir()


PROGRAM = """
import numpy as np, problems
from problems import targets
problem = problems.load("sitnikov")
field = targets.numba(problem.system, "force")
out = np.empty(9)
field(0.0, problem.y0[:9], problem.par, out)
print(sum(field.stats.cache_hits.values()), sum(field.stats.cache_misses.values()), out[0])
"""


def test_a_second_process_compiles_nothing(tmp_path):
    environment = os.environ | {"HBVM_BENCH_CACHE": str(tmp_path)}
    shown = [
        subprocess.run(
            [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True, env=environment
        )
        for _ in range(2)
    ]
    first, second = (process.stdout.split() for process in shown)
    assert first[:2] == ["0", "1"]
    assert second[:2] == ["1", "0"]
    assert first[2] == second[2]
