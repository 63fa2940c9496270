"""LLVM's text of the kernel beside the package: the same machine code, or as if it were not there."""

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
from integrators.kernel.native import binary, jit, lowered, machine

ENGINE = ENGINES["ensembles"]  # the smallest
ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def text():
    return ENGINE.lower()


@pytest.fixture
def file(text, tmp_path, monkeypatch):
    monkeypatch.setattr(lowered, "FOLDER", tmp_path / "lowered")
    lowered.write({ENGINE.key: text})
    (file,) = (tmp_path / "lowered").iterdir()
    return file


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
    for n in (0, 1, 7, 1000):
        results = [
            ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(machine.load(code))(n)
            for code in (
                binary.build(jit.compiled(logistic), *signature),
                binary.build_lowered(binary.lower(jit.compiled(logistic), *signature)),
            )
        ]
        assert results == [logistic(n)] * 2


def test_what_lies_there_is_what_was_lowered(text, file):
    assert lowered.get(ENGINE.key) == text


def test_numba_is_asked_only_where_there_is_none(file, tmp_path, monkeypatch):
    asked = []

    def lowered_by_numba(*arguments):
        asked.append(arguments)
        return b""

    monkeypatch.setattr(binary, "build", lowered_by_numba)
    monkeypatch.setattr(binary, "load", lambda code: 1 + len(code))
    monkeypatch.setattr(binary, "_loaded", {})
    monkeypatch.setenv("HBVM_BENCH_CACHE", str(tmp_path / "first"))
    assert ENGINE.code().address > 1000
    assert not asked
    lowered.write({ENGINE.key: "no text of LLVM"})
    monkeypatch.setattr(binary, "_loaded", {})
    monkeypatch.setenv("HBVM_BENCH_CACHE", str(tmp_path / "second"))
    assert ENGINE.code().address == 1
    assert asked


@pytest.mark.parametrize("content", [b"", b"no archive", lzma.compress(b"no archive")])
def test_what_cannot_be_read_is_not_there(file, content):
    file.write_bytes(content)
    assert lowered.get(ENGINE.key) is None


def test_a_broken_archive_is_as_if_it_were_not_there(file):
    file.write_bytes(file.read_bytes()[:-1000])
    assert lowered.get(ENGINE.key) is None


def test_each_text_of_an_archive_is_found(file):
    texts = {"first": "a" * 1000, "second": "b", "third": "c" * 10**6}
    lowered.write(texts)
    assert {key: lowered.get(key) for key in reversed(texts)} == texts


def test_that_of_other_sources_systems_and_later_versions_is_not_there(file, text, monkeypatch):
    assert lowered.get(ENGINE.key + "0") is None
    version = llvm.llvm_version_info[0]
    for other in (version - 1, version + 1):
        file = file.rename(file.with_name(f"{llvm.get_process_triple()}.{other}.tar.xz"))
        assert lowered.get(ENGINE.key) is None
    lowered.write({ENGINE.key: text})  # and what lay there is gone
    assert len(list(file.parent.iterdir())) == 1
    monkeypatch.setattr(llvm, "get_process_triple", lambda: "mips-unknown-linux-gnu")
    assert lowered.get(ENGINE.key) is None


WAYS = """
import sys
from pathlib import Path
import pytest
from integrators.kernel import ahead
from integrators.kernel.native import engine, lowered
lowered.FOLDER = Path(sys.argv[1])
ahead.lower()
def by_numba(self):
    raise AssertionError(f"{self.key} was not lowered")
engine.Engine._compiled = by_numba
options = ["-o", "addopts=", "-q", "-p", "no:cacheprovider", "-m", "portable"]
sys.exit(pytest.main([*options, "tests/integrators/test_processors.py"]))
"""


@pytest.mark.slow
def test_each_way_through_the_kernel_from_its_text(tmp_path):
    environment = os.environ | {"HBVM_BENCH_CACHE": str(tmp_path / "cache")}
    command = [sys.executable, "-c", WAYS, str(tmp_path / "lowered")]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
