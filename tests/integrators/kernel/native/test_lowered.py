"""LLVM's text of the kernel beside the package: the same machine code, or as if it were not there."""

import lzma

import llvmlite.binding as llvm
import pytest

from integrators.kernel.ahead import ENGINES
from integrators.kernel.native import binary, lowered

ENGINE = ENGINES["ensembles"]  # the smallest


@pytest.fixture(scope="module")
def text():
    return ENGINE.lower()


@pytest.fixture
def file(text, tmp_path, monkeypatch):
    monkeypatch.setattr(lowered, "FOLDER", tmp_path / "lowered")
    lowered.write({ENGINE.key: text})
    (file,) = (tmp_path / "lowered").iterdir()
    return file


def test_it_becomes_the_same_object_file(text, file):
    assert lowered.get(ENGINE.key) == text
    assert binary.build_lowered(text) == binary.build(*ENGINE._compiled())


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
    file.write_bytes(lzma.compress(b"no text of LLVM"))
    monkeypatch.setattr(binary, "_loaded", {})
    monkeypatch.setenv("HBVM_BENCH_CACHE", str(tmp_path / "second"))
    assert ENGINE.code().address == 1
    assert asked


@pytest.mark.parametrize("content", [b"", b"no archive"])
def test_what_cannot_be_read_is_not_there(file, content):
    file.write_bytes(content)
    assert lowered.get(ENGINE.key) is None


def test_that_of_other_sources_systems_and_later_versions_is_not_there(file, text, monkeypatch):
    assert lowered.get(ENGINE.key + "0") is None
    for other in (-1, 1):
        version = f".{llvm.llvm_version_info[0] + other}.xz"
        file = file.rename(file.with_name(file.name.partition(".")[0] + version))
        assert lowered.get(ENGINE.key) is None
    lowered.write({ENGINE.key: text})  # and what lay there is gone
    assert len(list(file.parent.iterdir())) == 1
    monkeypatch.setattr(llvm, "get_process_triple", lambda: "mips-unknown-linux-gnu")
    assert lowered.get(ENGINE.key) is None
