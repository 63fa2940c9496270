"""Problems by name: the files of the catalogue, and what other packages offer."""

import subprocess
import sys
from dataclasses import dataclass
from importlib.metadata import EntryPoint

import pytest

from problems import registry
from problems.errors import InputError

GUEST = """
from problems import Hamiltonian, Problem
from problems.checks import Positive
from problems.entry import entry


@entry(title="a rotor", references=("somebody",), notes="Turns.", shows=("p",))
def rotor(*, p: Positive = 1.0, t_end: float = 10.0) -> Problem:
    return Problem(Hamiltonian(lambda p: p[0] ** 2 / 2, dof=1), q0=[0.0], p0=[p], t_end=t_end)


def plain(*, t_end: float = 10.0):
    return Problem(Hamiltonian(lambda p: p[0] ** 2 / 2, dof=1), q0=[0.0], p0=[1.0], t_end=t_end, name="plain")
"""


@dataclass
class Distribution:
    name: str


def offer(name, value, distribution):
    made = EntryPoint(name, value, registry.GROUP)
    vars(made)["dist"] = Distribution(distribution)
    return made


@pytest.fixture
def offered(monkeypatch):
    """Offer problems of made-up distributions, and forget them afterwards."""
    entries = []
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: entries)
    registry._entries.cache_clear()
    yield entries
    registry._entries.cache_clear()


@pytest.fixture
def guest(tmp_path, monkeypatch):
    (tmp_path / "guest_rotor.py").write_text(GUEST)
    monkeypatch.syspath_prepend(tmp_path)
    yield "guest_rotor"
    sys.modules.pop("guest_rotor", None)


def test_every_file_of_the_catalogue_is_a_problem_and_no_package_has_to_say_so(offered):
    assert len(registry.built_in()) >= 26
    assert registry.names() == registry.built_in()
    for name in registry.built_in():
        make = registry.factory(name)
        assert (make.__module__, make.__name__) == (f"problems.catalogue.{name}", name)
        assert registry.entry(name).picture is not None
        assert registry.entry(name).expected is not None


def test_a_problem_is_loaded_without_the_others():
    code = (
        "import sys, problems; problems.names(); problems.load('kepler')\n"
        "print(*(name for name in sys.modules if name.startswith('problems.catalogue.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = [name for name in done.stdout.split() if not name.startswith("problems.catalogue._")]
    assert loaded == ["problems.catalogue.kepler"]


def test_a_name_that_two_offer_is_refused_with_both(offered):
    offered.append(offer("kepler", "guest.orbits:kepler", "hbvm-guest"))
    with pytest.raises(InputError, match=r"offered by hbvm-bench \(.*\) and hbvm-guest \(.*\); un"):
        registry.load("kepler")
    assert registry.names() == registry.built_in()
    assert registry.load("pendulum").system.name == "pendulum"


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("no_such_module:orbits", "cannot be imported from no_such_module:orbits, ModuleNotFoundError"),
        ("problems:orbits", "cannot be imported from problems:orbits, AttributeError"),
        ("math:pi", r"is 3\.14.* at math:pi, not a function"),
    ],
)
def test_what_cannot_be_imported_is_told_with_its_place(offered, value, message):
    offered.append(offer("orbits", value, "hbvm-guest"))
    with pytest.raises(InputError, match=f"the problem 'orbits' {message}"):
        registry.load("orbits")


def test_the_same_problem_found_twice_is_one(offered, guest):
    offered += [offer("plain", f"{guest}:plain", "hbvm-guest")] * 2
    assert repr(registry.load("plain")) == "plain()"


def test_a_guest_may_be_described_like_a_built_in_problem_or_not(offered, guest):
    offered += [offer(name, f"{guest}:{name}", "hbvm-guest") for name in ("rotor", "plain")]
    assert repr(registry.load("rotor", t_end=3.0)) == "rotor(p=1.0, t_end=3.0)"
    assert registry.entry("rotor").title == registry.load("rotor").title == "a rotor"
    assert registry.entry("plain") is None
    for name, message in (
        ("rotor", "unknown argument of rotor 'pp'"),
        ("plain", "unknown argument of plain 'pp'"),
    ):
        with pytest.raises(InputError, match=message):
            registry.load(name, pp=1.0)
    assert not {"rotor", "plain"} & set(registry.built_in())
