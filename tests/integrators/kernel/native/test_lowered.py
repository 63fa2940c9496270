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
