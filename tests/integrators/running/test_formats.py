"""Files of the last format are read, and those of formats that are not known are refused in one sentence."""

import hashlib
import pickle

import numpy as np
import pytest

import problems
from integrators import Gauss, Leapfrog, integrate, load
from integrators.running import watch
from problems import InputError

TIMES = np.linspace(0.0, 20.0, 101)


def interrupted(path, method):
    """Write a checkpoint in the middle of an integration."""
    heard = []

    def hear(progress):
        heard.append(progress)
        if len(heard) == 3:
            raise KeyboardInterrupt

    made = integrate(problems.load("kepler"), method, TIMES, checkpoint=path, every_seconds=0, progress=hear)
    assert made.status == "interrupted"


def rewritten(path, change):
    """Change the content of a checkpoint, and its format."""
    magic, head, _, kept = path.read_bytes().split(b"\n", 3)
    magic, kept = change(magic, kept)
    path.write_bytes(b"\n".join([magic, head, hashlib.sha256(kept).hexdigest().encode(), kept]))


def as_format_1(magic, kept):
    """Return a checkpoint as the version before wrote it: nested, with modules under their former names."""
    old = pickle.dumps({"way": pickle.loads(kept)}, protocol=0)
    assert b"integrators.running.checkpoints" in old
    return b"hbvm-bench checkpoint 1", old.replace(
        b"integrators.running.checkpoints", b"integrators.checkpoints"
    )


@pytest.mark.parametrize("method", [Gauss(s=3, h=0.05), Leapfrog(h=0.01)], ids=repr)
def test_a_checkpoint_of_the_last_format_goes_on_with_the_same_bits(tmp_path, method):
    path = tmp_path / "kept"
    interrupted(path, method)
    rewritten(path, as_format_1)
    again = integrate(problems.load("kepler"), method, TIMES, resume=path)
    assert np.array_equal(again.y, integrate(problems.load("kepler"), method, TIMES).y)


def test_every_format_has_a_reader_and_the_last_one_too():
    assert {*watch.READERS} == {watch.VERSION - 1, watch.VERSION}


def test_a_checkpoint_of_an_unknown_format_is_refused(tmp_path):
    path = tmp_path / "kept"
    interrupted(path, Gauss(s=3, h=0.05))
    rewritten(path, lambda magic, kept: (b"hbvm-bench checkpoint 7", kept))
    with pytest.raises(InputError, match="of format 7, and this version reads 1 and 2; resume it with"):
        integrate(problems.load("kepler"), Gauss(s=3, h=0.05), TIMES, resume=path)


def test_a_checkpoint_of_steps_with_other_numbers_is_refused():
    problem = problems.load("kepler")
    stepper = Gauss(s=3, h=0.05).compile(problem.system).start(problem.y0, problem.par)
    kept = stepper.checkpoint()
    kept.words.popitem()
    with pytest.raises(InputError, match="of another version of hbvm-bench"):
        stepper.restore(kept)


def test_a_solution_of_an_unknown_format_is_refused(tmp_path):
    path = tmp_path / "solution.npz"
    integrate(problems.load("kepler"), Gauss(s=3, h=0.05), TIMES).save(path)
    with np.load(path) as file:
        arrays = dict(file)
    words = arrays["words"].tobytes().replace(b'"format": 1', b'"format": 7')
    np.savez(path, **{**arrays, "words": np.frombuffer(words, dtype=np.uint8)})
    with pytest.raises(InputError, match="is of format 7, which this version does not read"):
        load(path)
