"""Names under which two distributions offer problems."""

from dataclasses import dataclass
from importlib.metadata import EntryPoint

import pytest

from problems import registry
from problems.errors import InputError


@dataclass
class Distribution:
    name: str


def entry(name, value, distribution):
    made = EntryPoint(name, value, registry.GROUP)
    vars(made)["dist"] = Distribution(distribution)
    return made


@pytest.fixture
def offered(monkeypatch):
    """Offer problems of made-up distributions, and forget them afterwards."""
    entries = []
    monkeypatch.setattr(registry, "entry_points", lambda group: entries)
    registry._entries.cache_clear()
    yield entries
    registry._entries.cache_clear()


def test_a_name_that_two_offer_is_refused_with_both(offered):
    offered += [
        entry("kepler", "problems.catalogue.kepler:kepler", "hbvm-bench"),
        entry("kepler", "guest.orbits:kepler", "hbvm-guest"),
        entry("pendulum", "problems.catalogue.pendulum:pendulum", "hbvm-bench"),
    ]
    with pytest.raises(InputError, match=r"offered by hbvm-bench \(.*\) and hbvm-guest \(.*\); un"):
        registry.load("kepler")
    assert registry.names() == ["kepler", "pendulum"]
    assert registry.load("pendulum").system.name == "pendulum"


def test_the_same_problem_found_twice_is_one(offered):
    offered += [entry("pendulum", "problems.catalogue.pendulum:pendulum", "hbvm-bench")] * 2
    assert registry.load("pendulum").system.name == "pendulum"
