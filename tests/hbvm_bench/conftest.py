import os
import sys
from pathlib import Path

import pytest

import integrators.registry
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.measure import reading
from hbvm_bench.run.task import execute, idle, request_of
from hbvm_bench.store.store import Store
from problems.errors import InputError

HERE = Path(__file__).parent
TOYS = (
    "Steady",
    "Waving",
    "Pinned",
    "Counting",
    "Cautious",
    "Straying",
    "Stalling",
    "Endless",
    "Compiling",
    "Crashing",
    "Raising",
    "Exiting",
    "Hungry",
    "Garbage",
    "Refusing",
    "Missing",
)
SHORT = "sitnikov(t_end=1.0)"


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call():
    """Let all tests have one environment: a process that waits to be asked again serves one alone."""
    os.environ.pop("PYTEST_CURRENT_TEST", None)
    return (yield)


@pytest.fixture(scope="session")
def toy_path(tmp_path_factory):
    """Return folders that, on the path, are an installed distribution of toy methods."""
    folder = tmp_path_factory.mktemp("site")
    info = folder / "toys-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toys\nVersion: 1.0\n")
    lines = [f"{name} = toy_methods:{name}" for name in TOYS]
    (info / "entry_points.txt").write_text("\n".join(["[hbvm_bench.integrators]", *lines]) + "\n")
    return [str(folder), str(HERE)]


@pytest.fixture
def toys(toy_path, monkeypatch):
    """Install the toy methods in this process and in its children."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([*toy_path, os.environ.get("PYTHONPATH", "")]))
    for folder in toy_path:
        monkeypatch.syspath_prepend(folder)
    integrators.registry._entries.cache_clear()
    yield
    integrators.registry._entries.cache_clear()
    sys.modules.pop("toy_methods", None)


def end_idle():
    """End the processes that wait to be asked again."""
    for _, process in idle._waiting:
        process.close()


def run_case(case, directory, limits):
    """Integrate one case in a process of its own, store it, and return it with its reading."""
    made, series = execute(request_of(resolve(case), limits))
    store = Store(Path(directory))
    store.save(made, series or None)
    return reading.up_to_date(store, made)


def stored(store):
    """Return when each case that a store has was measured, and its bits; nothing before it has any."""
    if not store.path.is_file():
        return {}
    try:
        return {one.id: (one.finished, store.packed_series(one.id)) for one in store.everything()}
    except InputError:
        return {}
