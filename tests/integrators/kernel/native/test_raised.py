"""Ctrl-C while compiled code calls Python back."""

import signal
import sys
import threading
import time

import pytest

import problems
from integrators import HBVM, Event, Gauss, integrate
from integrators.protocol import Status

HENON_HEILES = problems.load("henon_heiles")
TURN = problems.Problem(problems.Opaque(lambda t, y: [y[1], -y[0]], dim=2), y0=[0.0, 1.0], t_end=10.0)
HEARD = Event(lambda t, y: float(y[0]), name="g")
LARGE = problems.load("sine_gordon", n=200)
WHERE = {
    "a field": ("field", TURN, HBVM(k=8, s=4, h=0.1), {}),
    "an event": ("_call", HENON_HEILES, HBVM(k=8, s=4, h=0.1), {"events": HEARD}),
    "a factorization": ("_called", LARGE, Gauss(s=4, h=0.01, solver="newton"), {}),
}

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")


@pytest.mark.parametrize("where", WHERE)
def test_it_is_heard_before_a_callbacks_first_line(where):
    """Nothing in the callback can catch it there, and ctypes would drop it."""
    called, problem, method, given = WHERE[where]
    integrate(problem, method, [0.2], **given)  # compiles
    calls = []

    def press(frame, event, argument):
        if event == "call" and frame.f_code.co_name == called and "integrators" in frame.f_code.co_filename:
            calls.append(event)
            if len(calls) == 5:
                signal.raise_signal(signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    sys.setprofile(press)
    try:
        made = integrate(problem, method, [3.0], **given)
    finally:
        sys.setprofile(None)
    assert (made.status, len(calls) >= 5) == (Status.INTERRUPTED, True)
    assert signal.getsignal(signal.SIGINT) is before


def test_a_second_one_ends_a_function_that_does_not_return():
    slept, main = [], threading.get_ident()

    def field(t, y):
        if t > 0.5:
            try:
                time.sleep(30.0)
            finally:
                slept.append(t)
        return [y[1], -y[0]]

    def press():
        for _ in range(2):
            time.sleep(0.2)
            signal.pthread_kill(main, signal.SIGINT)

    problem = problems.Problem(problems.Opaque(field, dim=2), y0=[0.0, 1.0], t_end=10.0)
    integrate(problem, HBVM(k=4, s=2, h=0.1), [0.2])
    threading.Thread(target=press).start()
    started = time.perf_counter()
    made = integrate(problem, HBVM(k=4, s=2, h=0.1), [10.0])
    assert (made.status, len(slept)) == (Status.INTERRUPTED, 1)
    assert time.perf_counter() - started < 10.0  # measured 0.5 s; 30 s if it slept on


def test_a_handler_that_raises_nothing_ends_nothing():
    seen = []

    def field(t, y):
        signal.raise_signal(signal.SIGINT)
        return [y[1], -y[0]]

    problem = problems.Problem(problems.Opaque(field, dim=2), y0=[0.0, 1.0], t_end=1.0)
    before = signal.signal(signal.SIGINT, lambda number, frame: seen.append(number))
    try:
        made = integrate(problem, HBVM(k=4, s=2, h=0.5), [1.0])
    finally:
        signal.signal(signal.SIGINT, before)
    assert (made.status, len(seen) > 10) == (Status.FINISHED, True)


def test_a_field_in_python_costs_the_calls_of_no_other_program():
    """Before, every later call of the kernel in the process exchanged the handler of Ctrl-C."""
    integrate(TURN, HBVM(k=4, s=2, h=0.1), [0.2])
    stepper = HBVM(k=4, s=2, h=0.1).compile(HENON_HEILES.system).start(HENON_HEILES.y0)
    called = HBVM(k=4, s=2, h=0.1).compile(TURN.system).start(TURN.y0)
    exchanged, exchange = [], signal.signal

    def watched(*arguments):
        exchanged.append(arguments)
        return exchange(*arguments)

    signal.signal = watched
    try:
        stepper.step()
        stepper.advance([1.0])
        assert exchanged == []
        called.step()
        assert len(exchanged) == 2
    finally:
        signal.signal = exchange
