"""Methods by name: the built-in ones need no installation, a third party's are found beside them."""

from importlib.metadata import EntryPoint

import pytest

from integrators import registry
from problems.errors import InputError


@pytest.fixture
def offered(monkeypatch):
    """Let entry points be offered by third parties."""

    def offer(**values):
        made = [EntryPoint(name, value, registry.GROUP) for name, value in values.items()]
        monkeypatch.setattr("importlib.metadata.entry_points", lambda group: made)
        registry._entries.cache_clear()

    yield offer
    registry._entries.cache_clear()


def test_each_built_in_method_is_where_the_table_says(offered):
    offered()
    assert registry.names() == sorted(name for own in registry.BUILT_IN.values() for name in own)
    for name in registry.names():
        assert registry.get(name).__name__ == name


def test_a_third_partys_method_stands_beside_them(offered):
    offered(Ours="integrators.methods.gauss:Gauss")
    assert "HBVM" in registry.names()
    assert registry.create("Ours", s=2, h=0.1) == registry.create("Gauss", s=2, h=0.1)


def test_a_second_method_of_the_same_name_is_refused(offered):
    offered(HBVM="elsewhere:HBVM")
    with pytest.raises(InputError, match=r"two packages offer a method 'HBVM': .* and elsewhere:HBVM;"):
        registry.get("HBVM")
