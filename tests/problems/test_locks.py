"""A lock among processes, by the call that Unix has and by its substitute."""

import subprocess
import sys
import threading

import pytest

from problems import locks

HOLD = """
import sys, time
from pathlib import Path
from problems import locks
if sys.argv[2] == "without fcntl":
    locks.fcntl = None
with locks.held(Path(sys.argv[1]), wait=True):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture(params=["fcntl", "without fcntl"], autouse=True)
def _way(request, monkeypatch):
    if request.param == "without fcntl":
        monkeypatch.setattr(locks, "fcntl", None)
    elif locks.fcntl is None:
        pytest.skip("this system has no fcntl")


@pytest.mark.parametrize("kind", ["file", "directory"])
def test_one_holds_it_at_a_time(tmp_path, kind):
    path = tmp_path if kind == "directory" else tmp_path / "lock"
    with locks.held(path, wait=False), pytest.raises(BlockingIOError), locks.held(path, wait=False):
        pass
    with locks.held(path, wait=False):
        pass


def test_who_waits_gets_it_after_the_other(tmp_path):
    order = []

    def other():
        with locks.held(tmp_path / "lock", wait=True):
            order.append("other")

    with locks.held(tmp_path / "lock", wait=True):
        waiting = threading.Thread(target=other)
        waiting.start()
        waiting.join(0.2)
        order.append("first")
    waiting.join(10)
    assert order == ["first", "other"]


def test_it_ends_with_a_process_that_is_killed(tmp_path, request):
    way = request.node.callspec.params["_way"]
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path / "lock"), way], stdout=subprocess.PIPE, text=True
    )
    with holder, holder.stdout:
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(BlockingIOError), locks.held(tmp_path / "lock", wait=False):
            pass
        holder.kill()
        holder.wait()
        with locks.held(tmp_path / "lock", wait=False):
            pass


def test_what_cannot_be_locked_is_an_error_of_the_system(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OSError), locks.held(tmp_path / "file" / "lock", wait=False):  # noqa: PT011
        pass
