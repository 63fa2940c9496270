"""Names of modules that have moved: they work for one minor version, with a warning."""

import importlib
from importlib.metadata import version

import pytest

import integrators

PLACES = [(former, f"integrators.{now}") for former, now in integrators._FORMER.items()]


@pytest.mark.parametrize(("former", "place"), PLACES)
def test_a_former_name_gives_the_present_module_s_own_objects_and_warns(former, place):
    present = importlib.import_module(place)
    name = next(name for name, value in vars(present).items() if getattr(value, "__module__", "") == place)
    with pytest.warns(DeprecationWarning, match=rf"integrators\.{former} has moved to {place}") as warned:
        found = getattr(importlib.import_module(f"integrators.{former}"), name)
    assert found is getattr(present, name)
    assert warned[0].filename == __file__
    with pytest.raises(AttributeError):
        importlib.import_module(f"integrators.{former}").no_such_name  # noqa: B018


def test_imports_by_former_names_leave_the_function_of_the_same_name_in_place():
    with pytest.warns(DeprecationWarning, match="has moved"):
        from integrators.integrate import DEFAULT_SAMPLES  # noqa: F401
    assert integrators.integrate.__module__ == "integrators.running.integrate"
    with pytest.warns(DeprecationWarning, match="has moved"):
        assert integrators.hbvm.HBVM is integrators.HBVM


def test_former_names_are_removed_with_the_version_that_their_warning_names():
    release = tuple(int(part) for part in version("hbvm-bench").split(".")[:2])
    assert release < (0, 2), "delete _FORMER of integrators/__init__.py"
