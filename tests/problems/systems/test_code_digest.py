"""What a field in code is: all that it takes from modules and classes, too."""

import sys
from types import ModuleType

import numpy as np
import pytest

from integrators import HBVM, integrate
from problems import Opaque, Problem
from problems.errors import InputError
from problems.systems.code_digest import code_digest


@pytest.fixture
def module(tmp_path, monkeypatch):
    (tmp_path / "laws_of_mine.py").write_text(
        "G = 1.0\nUNUSED = 1.0\ndef pull(q):\n    return -G*q\nclass Constants:\n    k = 2.0\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    import laws_of_mine  # pyright: ignore[reportMissingImports]

    yield laws_of_mine
    del sys.modules["laws_of_mine"]


def field(laws: ModuleType):
    def inner(t, y):
        return np.array([y[1], laws.G * laws.Constants.k * laws.pull(y[0])])

    return inner


def test_attributes_and_helpers_of_a_module_count(module, monkeypatch):
    def digest():
        return code_digest(field(module), 2, "mine")

    before = digest()
    assert digest() == before
    monkeypatch.setattr(module, "UNUSED", 7.0)
    assert digest() == before
    for owner, name, value in (
        (module, "G", 2.0),  # before, none of these was noticed
        (module, "pull", lambda q: -(q**3)),
        (module.Constants, "k", 5.0),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, value)
            assert digest() != before, name
    assert digest() == before


def test_a_module_imported_within_a_function_counts(module, monkeypatch):
    def inner(t, y):
        import laws_of_mine  # pyright: ignore[reportMissingImports]

        return [laws_of_mine.G * y[0]]

    before = code_digest(inner, 1, "mine")
    monkeypatch.setattr(module, "G", 2.0)
    assert code_digest(inner, 1, "mine") != before


def test_a_resume_with_a_changed_module_is_refused(module, monkeypatch, tmp_path):
    def solve(end, **options):
        problem = Problem(Opaque(field(module), dim=2, name="mine"), y0=[1.0, 0.0], t_end=5.0)
        return integrate(problem, HBVM(k=8, s=4, tol=1e-8), [end], **options)

    path = tmp_path / "run.ckpt"
    solve(5.0, checkpoint=path)
    solve(5.0, resume=path)
    monkeypatch.setattr(module, "G", 3.0)
    with pytest.raises(InputError):
        solve(5.0, resume=path)
