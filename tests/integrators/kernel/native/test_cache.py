"""Compiled code on disk: found again without numba, made anew when damaged, shared by processes at once."""

import json
import os
import shutil
import subprocess
import sys
import textwrap

import pytest

from integrators.kernel import tables
from integrators.kernel.engines import steps
from integrators.kernel.native import binary, store

# A system of its own for each constant; prints whether numba was needed, and a result.
SCRIPT = textwrap.dedent(
    """
    import json, sys
    import problems, integrators
    constant = float(sys.argv[1])

    def H(q, p, m):
        return p[0] * p[0] / 2 + constant * q[0] * q[0] * q[0] * q[0]

    problem = problems.Problem(problems.Hamiltonian(H, dof=1, name="quartic"), q0=[1.0], p0=[0.0], t_end=1.0)
    program = integrators.Gauss(s=6, h=0.1).compile(problem.system)
    samples = program.start(problem.y0).advance([1.0])
    print(json.dumps({
        "cached": program.from_cache,
        "imports": [name for name in ("numba", "mpmath", "scipy", "heyoka", "jax") if name in sys.modules],
        "q": samples.y[0, 0].hex(),
        "seconds": program.compile_seconds,
    }))
    """
)


def start(folder, constant):
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(constant)],
        env={**os.environ, "HBVM_BENCH_CACHE": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process):
    out, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    return json.loads(out)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A cache folder in which the kernel, from this process's cache, and the field of constant 0.25 are."""
    folder = tmp_path_factory.mktemp("cache")
    address = steps.code().address
    (name,) = [name for name, code in binary._loaded.items() if code.address == address]
    kernel = store._path(store.key(name, binary.platform()))
    (folder / "native" / kernel.parent.name).mkdir(parents=True)
    shutil.copy(kernel, folder / "native" / kernel.parent.name)
    first = finish(start(folder, 0.25))
    assert not first["cached"]
    assert "numba" in first["imports"]
    return folder, first["q"]


def files(folder):
    return sorted(path for path in (folder / "native").rglob("*") if path.is_file())


def test_a_second_process_compiles_nothing_and_does_not_even_import_numba(cache):
    folder, q = cache
    second = finish(start(folder, 0.25))
    assert second["cached"]
    assert second["imports"] == []
    assert second["q"] == q
    assert second["seconds"] < 1.0  # measured 0.02 alone, 0.3 beside other work


def test_another_system_costs_its_field_only(cache):
    folder, _ = cache
    before = files(folder)
    other = finish(start(folder, 0.375))
    assert not other["cached"]
    assert len(files(folder)) == len(before) + 2  # by itself, and in whole iterations


def test_processes_that_start_at_once_agree_and_leave_no_debris(cache):
    folder, _ = cache
    before = set(files(folder))
    results = [finish(process) for process in [start(folder, 0.5) for _ in range(4)]]
    assert len({result["q"] for result in results}) == 1
    new = set(files(folder)) - before
    assert len(new) == 2
    assert not any(path.name.startswith(".") for path in new)
    assert finish(start(folder, 0.5))["cached"]


def test_damaged_files_are_made_anew(cache):
    folder, q = cache
    kernel = max(files(folder), key=lambda path: path.stat().st_size)  # takes long to make
    for i, path in enumerate(set(files(folder)) - {kernel}):
        content = bytearray(path.read_bytes())
        if i % 3 == 0:
            content[-1] ^= 1
        elif i % 3 == 1:
            del content[len(content) // 2 :]
        else:
            content.clear()
        path.write_bytes(bytes(content))
    repaired = finish(start(folder, 0.25))
    assert not repaired["cached"]
    assert repaired["q"] == q
    assert finish(start(folder, 0.25))["cached"]


def test_a_folder_that_cannot_be_written_costs_only_time(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "directory", lambda: tmp_path / "file" / "below")
    (tmp_path / "file").write_text("in the way")
    assert store.get("aa11") is None
    assert not store.put("aa11", b"content")


def test_what_was_put_is_got_and_keys_depend_on_every_part(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "directory", lambda: tmp_path)
    name = store.key("kind", "source", b"bytes")
    assert store.get(name) is None
    assert store.put(name, b"content")
    assert store.get(name) == b"content"
    assert len({name, store.key("kind", "source"), store.key("kindsource", "", b"bytes")}) == 3


def test_tables_from_the_store_make_the_bits_of_those_just_made(tmp_path, monkeypatch):
    monkeypatch.setenv("HBVM_BENCH_CACHE", str(tmp_path))
    made = []
    for _ in range(2):
        tables.constants.cache_clear()
        constants = tables.constants(10, 1, True, 16)
        made.append(tables.scaled(constants, 1.0, squared=True) | tables.fixed(constants))
    tables.constants.cache_clear()
    for name, table in made[0].items():
        assert table.tobytes() == made[1][name].tobytes(), name
