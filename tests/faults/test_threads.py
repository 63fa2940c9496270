"""One program in several threads, one stepper in several threads, a fork beside a compilation."""

import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import problems
from integrators import HBVM, LineIntegral, registry
from integrators.kernel.native import engine, foreign
from integrators.protocol import Status
from tests.faults.fault import Fault, is_met
from tests.faults.search import shared_memory

KEPLER = problems.load("kepler")


def in_thread(do):
    """Run ``do`` in another thread, to its end."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(do).result(timeout=60)


def test_parameters_of_another_thread_are_not_taken_for_its_own():
    """Just when the memory of one thread is known, another thread asks for that of other masses."""
    problem = problems.load("outer_solar_system")
    made = HBVM(k=4, s=2, h=1.0).compile(problem.system)
    heavy, light, others = problem.par * 3.0, problem.par * 7.0, []
    _, *contexts = made.contexts(heavy) and made._fresh

    class Key(bytes):
        def __ne__(self, other):
            if not others:
                others.append(light)
                in_thread(lambda: made.contexts(light))
            return bytes.__ne__(self, other)

    made._fresh = (Key(heavy.tobytes()), *contexts)
    assert all(np.array_equal(context.par, heavy) for context in made.contexts(heavy))
    assert others == [light], "the other thread never came between"


def test_an_error_of_a_function_stays_in_its_thread(monkeypatch):
    """While one thread still has its error in hand, another integrates to the end."""

    raised = []

    def bad(t, y):
        if t > 0.5:
            raised.append(t)
            raise LookupError("mine")
        return [y[1], -y[0]]

    def good(t, y):
        return [y[1], -y[0]]

    def run(f):
        system = problems.Opaque(f, dim=2)
        return HBVM(k=4, s=2, h=0.1).compile(system).start([1.0, 0.0]).advance([1.0])

    alone, inner, others = run(good), engine.raise_kept, []

    def raise_kept():
        if raised:
            raised.clear()
            others.append(in_thread(lambda: run(good)))
        inner()

    monkeypatch.setattr(engine, "raise_kept", raise_kept)
    made = run(bad)
    assert (made.status, len(others)) == (Status.USER_ERROR, 1)
    assert "LookupError (mine)" in made.reason
    assert np.array_equal(others[0].y, alone.y)


def test_a_field_is_made_for_all_threads_once(monkeypatch):
    """Else one thread is left with the address of code that the other has thrown away."""
    system, inner, count = problems.Opaque(lambda t, y: [y[1], -y[0]], dim=2, name="f"), foreign._called, []

    def slowly(*arguments):
        count.append(1)
        time.sleep(0.05)
        return inner(*arguments)

    monkeypatch.setattr(foreign, "_called", slowly)
    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(lambda _: foreign.field_of(system, "field", 8).address, range(4)))
    assert len(count) == 1
    assert len(set(made)) == 1


def test_one_program_serves_many_threads():
    """Different masses, one program: each thread gets the bits that it would get alone."""
    problem = problems.load("outer_solar_system")
    made = HBVM(k=8, s=4, h=1.0).compile(problem.system)
    masses = [problem.par * (1.0 + 0.01 * i) for i in range(40)]

    def run(par):
        return made.start(problem.y0, par).advance([20.0]).y

    alone = [run(par) for par in masses]
    with ThreadPoolExecutor(4) as pool:
        for ours, theirs in zip(alone, pool.map(run, masses), strict=True):
            assert np.array_equal(ours, theirs)


class Held:
    """Times that keep the one who reads them until they are let go."""

    def __init__(self):
        self.read, self.go = threading.Event(), threading.Event()

    def __array__(self, dtype=None, copy=None):
        self.read.set()
        assert self.go.wait(60)
        return np.array([1.0])


METHODS = [
    HBVM(k=4, s=2, h=0.1),
    HBVM(tol=1e-8),
    LineIntegral(k=4, s=2, h=0.1, invariants=["energy"]),
    registry.create("DOP853", rtol=1e-8, atol=1e-8),
]
ACTIONS = {
    "step": lambda stepper: stepper.step(),
    "advance": lambda stepper: stepper.advance([2.0]),
    "checkpoint": lambda stepper: stepper.checkpoint(),
    "y": lambda stepper: stepper.y,
}


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_stepper_at_work_is_refused_to_another_thread(method):
    made = method.compile(KEPLER.system)
    alone = made.start(KEPLER.y0, KEPLER.par).advance([1.0]).y
    stepper, held = made.start(KEPLER.y0, KEPLER.par), Held()
    with ThreadPoolExecutor(1) as pool:
        at_work = pool.submit(stepper.advance, held)
        assert held.read.wait(60)
        try:
            for name, do in ACTIONS.items():
                is_met(Fault(name, lambda do=do: do(stepper), "at work in another thread; start one stepper"))
        finally:
            held.go.set()
        assert np.array_equal(at_work.result(timeout=60).y, alone)
    stepper.step()  # it is free again


FORK = """
import os, threading, time, problems
from integrators import HBVM
from integrators.kernel.native import binary

started = threading.Event()

def compile_something():
    def make():
        started.set()
        time.sleep(0.3)
        raise LookupError
    try:
        binary.obtain("0" * 64, make)
    except LookupError:
        pass

thread = threading.Thread(target=compile_something)
thread.start()
started.wait()
child = os.fork()
if child == 0:
    problem = problems.load("kepler")
    HBVM(k=4, s=2, h=0.1).compile(problem.system).start(problem.y0).step()
    os._exit(7)
thread.join()
for _ in range(2400):
    done, status = os.waitpid(child, os.WNOHANG)
    if done:
        print("child", os.waitstatus_to_exitcode(status))
        break
    time.sleep(0.05)
else:
    os.kill(child, 9)
    print("child hangs")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no fork")
def test_a_child_forked_beside_a_compilation_does_not_hang():
    done = subprocess.run(
        [sys.executable, "-c", FORK], capture_output=True, text=True, timeout=150, check=True
    )
    assert done.stdout.strip() == "child 7", done.stderr


def in_a_fresh_process(*options):
    """Return what `tests.faults.search.shared_memory` prints of options, each in a process of its own."""
    done = []
    for option in options:
        command = [sys.executable, "-m", "tests.faults.search.shared_memory", option]
        ran = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
        done.append((option, ran.stdout.strip() or f"exit {ran.returncode}: {ran.stderr[-500:]}"))
    return done


QUICK = ("fixed steps and actions", "events in Python")


def test_threads_of_the_first_call_of_a_process_make_the_trajectories_of_one():
    """Before, a half of the first differed, or the process crashed: tables of one thread were freed."""
    assert in_a_fresh_process(*QUICK) == [(option, f"{option} 0") for option in QUICK]


@pytest.mark.slow
@pytest.mark.parametrize("option", shared_memory.OPTIONS)
def test_so_they_do_with_every_option(option):
    for _ in range(3):
        assert in_a_fresh_process(option) == [(option, f"{option} 0")]
