"""An opaque system under its former name: programs, pickles and checkpoints that have it still work."""

import pickle

import numpy as np
import pytest

import problems
from integrators import HBVM, integrate
from problems import Opaque, Problem


def decay(t, y):
    return [-y[0]]


def test_the_former_name_is_the_same_class_and_warns():
    with pytest.warns(DeprecationWarning, match="'Foreign' is now called 'Opaque'.* version 0.2"):
        assert problems.Foreign is Opaque


def test_no_other_name_is_found():
    with pytest.raises(AttributeError, match="no attribute 'Foreigner'"):
        _ = problems.Foreigner


def test_a_pickle_with_the_former_name_loads():
    text = pickle.dumps(Opaque(decay, dim=1), protocol=0)
    former = text.replace(b"cproblems.systems.opaque\nOpaque\n", b"cproblems.systems.untraced\nForeign\n")
    assert former != text
    system = pickle.loads(former)
    assert type(system) is Opaque
    assert system.f is decay


def test_a_checkpoint_with_the_former_name_is_resumed(tmp_path):
    problem = Problem(Opaque(decay, dim=1), y0=[1.0], t_end=5.0)
    path, times = tmp_path / "checkpoint", np.linspace(0.0, 5.0, 6)
    whole = integrate(problem, HBVM(), times, checkpoint=path)
    head, kept = path.read_bytes().split(b"\n", 2)[1:]
    former = head.replace(b"Problem(Opaque(", b"Problem(Foreign(")
    assert former != head
    magic = path.read_bytes().split(b"\n", 1)[0]
    path.write_bytes(b"\n".join([magic, former, kept]))
    assert np.array_equal(integrate(problem, HBVM(), times, resume=path).y, whole.y)
