"""Caches and disks: code under another's name, many cold starts, folders that are read-only or full."""

import errno
import os
import shutil
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from integrators.kernel.native import binary, store
from problems.targets import cache

from .fault import Fault, is_met

OBTAIN = textwrap.dedent(
    """
    import os, sys, time
    from pathlib import Path
    from integrators.kernel.native import binary

    def make():
        log = os.open(sys.argv[1], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(log, b"made\\n")
        time.sleep(float(sys.argv[2]))
        return " ", b"code"

    binary.load = len
    print("ready", flush=True)
    started = binary.clock()
    print(binary.obtain("some key", make).from_cache, binary.clock() - started < 1.0, flush=True)
    """
)


def starting(folder, seconds):
    return subprocess.Popen(
        [sys.executable, "-c", OBTAIN, str(folder / "log"), str(seconds)],
        env={**os.environ, "HBVM_BENCH_CACHE": str(folder / "cache")},
        stdout=subprocess.PIPE,
        text=True,
    )


def test_of_processes_that_need_the_same_code_one_compiles(tmp_path):
    answers = [one.communicate(timeout=60)[0] for one in [starting(tmp_path, 1.5) for _ in range(4)]]
    assert (tmp_path / "log").read_text() == "made\n"
    # code from the cache in a moment, whatever the wait: 0.01 s measured beside other work
    assert sorted(answers) == ["ready\nFalse False\n", *3 * ["ready\nTrue True\n"]]


def test_one_that_dies_while_it_compiles_stops_nobody(tmp_path):
    first = starting(tmp_path, 600.0)
    while not (tmp_path / "log").exists():
        time.sleep(0.01)
    second = starting(tmp_path, 0.0)
    assert second.stdout is not None
    assert second.stdout.readline() == "ready\n"
    first.kill()
    first.communicate()
    assert second.communicate(timeout=60)[0] == "False True\n"


def test_code_under_anothers_name_is_not_run(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "directory", lambda: tmp_path)
    one, other = store.key("one"), store.key("other")
    assert store.put(one, b"code of one")
    assert store.put(other, b"code of the other")
    shutil.copy(store._path(one), store._path(other))
    assert store.get(other) is None
    assert store.get(one) == b"code of one"


@pytest.fixture
def read_only(tmp_path, monkeypatch):
    """Return a cache folder on a disk that refuses everything but reading."""
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    assert store.put("aa11", b"kept")
    warm = cache.module("ANSWER = 45\n", "warm")
    del sys.modules[warm.__name__]
    cache._prepared.cache_clear()

    def refuse(function):
        def refusing(*args, dir=None, **more):  # noqa: A002 -- as it is called
            if dir is not None and Path(dir).is_relative_to(tmp_path):
                raise OSError(errno.EROFS, "Read-only file system")
            return function(*args, dir=dir, **more)

        return refusing

    for name in ("TemporaryFile", "mkstemp"):
        monkeypatch.setattr(cache.tempfile, name, refuse(getattr(cache.tempfile, name)))
    yield tmp_path
    cache._prepared.cache_clear()


def test_a_warm_cache_that_can_only_be_read_is_used(read_only):
    before = {path for path in read_only.rglob("*") if path.is_file()}
    assert cache.directory() == read_only
    assert store.get("aa11") == b"kept"
    assert not store.put("bb22", b"new")
    assert cache.module("ANSWER = 45\n", "warm").ANSWER == 45
    assert cache.module("ANSWER = 46\n", "new").ANSWER == 46
    assert {path for path in read_only.rglob("*") if path.is_file()} == before


def test_where_nothing_can_be_locked_all_compile(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with cache.locked(tmp_path / "file" / "lock"):
        pass


def full(*args):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_generated_code_without_a_place_is_a_sentence(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    monkeypatch.setattr(cache, "_write", full)
    is_met(
        Fault("full disk", lambda: cache.module("ANSWER = 47\n", "full"), "No space left.*HBVM_BENCH_CACHE")
    )


def test_a_kernel_is_compiled_under_a_lock(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    monkeypatch.setattr(binary, "load", len)
    assert not binary.obtain("a key of this test", lambda: (" ", b"code")).from_cache
    assert len(list((tmp_path / "locks").iterdir())) == 1
