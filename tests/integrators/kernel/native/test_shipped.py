"""Machine code and texts of the kernel beside the package: the same results, or as if they were not there."""

import ctypes
import lzma
import math
import os
import subprocess
import sys
from pathlib import Path

import llvmlite.binding as llvm
import pytest
from numba import types

from integrators.kernel.ahead import ENGINES
from integrators.kernel.native import binary, jit, machine, shipped

ENGINE = ENGINES["ensembles"]  # the smallest
ROOT = Path(__file__).parents[4]


KEY = f"{ENGINE.key} {machine.level()}"


@pytest.fixture(scope="module")
def codes():
    return ENGINE.for_levels()


@pytest.fixture
def folder(codes, tmp_path, monkeypatch):
    monkeypatch.setattr(shipped, "FOLDER", tmp_path / "shipped")
    shipped.write(codes, {"text": "of LLVM"})
    return tmp_path / "shipped"


@pytest.fixture
def file(folder):
    return folder / f"{llvm.get_process_triple()}.tar.xz"


def logistic(n):
    x = 0.3
    for _ in range(n):
        x = 3.9 * x * (1.0 - x) + 1e-3 * math.sqrt(x) / (1.0 + x)
        if x > 1.0:
            x = x - 1.0
    return int(x * 2**52)


def test_its_machine_code_gives_the_same_bits():
    """A chaotic map shows any sum that is rounded otherwise, as one fused with a product would be."""
    signature = [(types.int64, "i64")], "i64"
    best = machine.level()
    allowed = machine.levels()[machine.levels().index(best) :]
    text = binary.lower(jit.compiled(logistic), *signature)
    codes = [binary.build_for(level, text) for level in allowed]
    codes.append(binary.build(jit.compiled(logistic), *signature))
    for n in (0, 1, 7, 1000):
        results = [ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(machine.load(code))(n) for code in codes]
        assert results == [logistic(n)] * len(codes)


@pytest.mark.parametrize("level", machine.levels())
def test_a_level_is_told_by_its_features(level, monkeypatch):
    target = llvm.Target.from_triple(llvm.get_process_triple())
    needed = machine.LEVELS[llvm.get_process_triple().split("-")[0]][level]
    for feature in needed:
        monkeypatch.setenv("NUMBA_CPU_FEATURES", ",".join(f"+{one}" for one in needed - {feature}))
        assert machine.level() != level
    monkeypatch.setenv("NUMBA_CPU_FEATURES", ",".join(f"+{one}" for one in needed))
    assert machine.level() == level
    assert target.create_target_machine(cpu=level)


def test_a_processor_without_the_features_has_no_level(monkeypatch):
    monkeypatch.setattr(llvm, "get_process_triple", lambda: "x86_64-unknown-linux-gnu")
    monkeypatch.setenv("NUMBA_CPU_FEATURES", "+sse4.2")
    assert machine.level() is None
    monkeypatch.setattr(llvm, "get_process_triple", lambda: "mips-unknown-linux-gnu")
    assert machine.level() is None
    assert machine.levels() == []


def test_what_lies_there_is_what_was_written(codes, folder):
    assert shipped.code(KEY) == codes[KEY]
    assert shipped.text("text") == "of LLVM"


def test_numba_is_asked_only_where_there_is_none(folder, tmp_path, monkeypatch):
    asked = []

    def built_by_numba(*arguments):
        asked.append(arguments)
        return b""

    monkeypatch.setattr(binary, "build", built_by_numba)
    monkeypatch.setattr(binary, "load", lambda code: 1 + len(code))
    monkeypatch.setattr(binary, "_loaded", {})
    monkeypatch.setenv("HBVM_BENCH_CACHE", str(tmp_path / "first"))
    assert ENGINE.code().address > 1000
    assert not asked
    shipped.write({}, {})
    monkeypatch.setattr(binary, "_loaded", {})
    monkeypatch.setenv("HBVM_BENCH_CACHE", str(tmp_path / "second"))
    assert ENGINE.code().address == 1
    assert asked


@pytest.mark.parametrize("content", [b"", b"no archive", lzma.compress(b"no archive")])
def test_what_cannot_be_read_is_not_there(file, content):
    file.write_bytes(content)
    assert shipped.code(KEY) is None


def test_a_broken_archive_is_as_if_it_were_not_there(file):
    file.write_bytes(file.read_bytes()[:-1000])
    assert shipped.code(KEY) is None


def test_each_text_of_an_archive_is_found(folder):
    texts = {"first": "a" * 1000, "second": "b", "third": "c" * 10**6}
    shipped.write({}, texts)
    assert {key: shipped.text(key) for key in reversed(texts)} == texts


def test_that_of_other_sources_and_systems_is_not_there(folder, monkeypatch):
    assert shipped.code(KEY + "0") is None
    shipped.write({}, {})  # and what lay there is gone
    assert shipped.code(KEY) is None
    monkeypatch.setattr(llvm, "get_process_triple", lambda: "mips-unknown-linux-gnu")
    assert shipped.code(KEY) is None


def test_a_text_is_of_one_version_of_llvm(folder):
    version = llvm.llvm_version_info[0]
    file = folder / f"{llvm.get_process_triple()}.{version}.tar.xz"
    for other in (version - 1, version + 1):
        file = file.rename(file.with_name(f"{llvm.get_process_triple()}.{other}.tar.xz"))
        assert shipped.text("text") is None


WAYS = """
import sys
from pathlib import Path
import pytest
from integrators.kernel import ahead
from integrators.kernel.native import engine, shipped
shipped.FOLDER = Path(sys.argv[1])
ahead.ship()
def by_numba(self):
    raise AssertionError(f"{self.key} was not shipped")
engine.Engine._compiled = by_numba
options = ["-o", "addopts=", "-q", "-p", "no:cacheprovider", "-m", "portable"]
sys.exit(pytest.main([*options, "tests/integrators/test_processors.py"]))
"""


@pytest.mark.slow
def test_each_way_through_the_kernel_from_what_is_shipped(tmp_path):
    environment = os.environ | {"HBVM_BENCH_CACHE": str(tmp_path / "cache")}
    command = [sys.executable, "-c", WAYS, str(tmp_path / "shipped")]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
