"""Compiling ahead: a process that comes later finds everything compiled."""

import subprocess
import sys

from integrators.kernel.ahead import ENGINES, compile_ahead

FIRST_USE = """
import integrators, problems
problem = problems.load("kepler", e=0.6)
solution = integrators.integrate(problem, integrators.HBVM(), times=[0.0, 1.0])
assert str(solution.status) == "finished", solution
"""


def test_all_engines_are_there_afterwards() -> None:
    compile_ahead()
    assert compile_ahead() == dict.fromkeys(ENGINES)


def test_what_was_compiled_ahead_is_not_waited_for() -> None:
    compile_ahead()
    watched = "from integrators.kernel.native import engine\nengine._say_what_is_waited_for = lambda: 1 / 0\n"
    subprocess.run([sys.executable, "-c", watched + FIRST_USE], check=True)
