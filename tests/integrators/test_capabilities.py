"""What is asked for beyond the protocol is declared, explained and checked."""

import ast
import inspect
from pathlib import Path

import pytest

import integrators
from integrators import HBVM, Gauss, Leapfrog, Taylor, protocol, testing
from integrators.protocol import CAPABILITIES, Checkpoints, Events, members, offers
from integrators.stepping import FixedStep
from integrators.testing.capabilities import CHECK_OF
from problems import InputError

ROOT = Path(integrators.__file__).parent


@pytest.mark.parametrize("capability", CAPABILITIES, ids=lambda capability: capability.__name__)
def test_a_capability_has_its_members_its_paragraph_and_its_check(capability):
    assert members(capability)
    assert all(
        name in inspect.getdoc(capability) or hasattr(capability, name) for name in members(capability)
    )
    assert f"`{capability.__name__}`" in protocol.__doc__
    assert CHECK_OF[capability] in testing.CHECKS


def test_every_capability_is_listed():
    own = {
        kind
        for _, kind in inspect.getmembers(protocol, inspect.isclass)
        if kind.__module__.startswith(protocol.__name__)
    }
    optional = {kind for kind in own if getattr(kind, "_is_protocol", False)} - {
        protocol.Stepper,
        protocol.Program,
    }
    assert optional == set(CAPABILITIES) == set(CHECK_OF)


def test_nothing_undeclared_is_asked_of_a_method_a_program_or_a_stepper():
    found = []
    for path in ROOT.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("getattr", "hasattr"):
                asked = ast.unparse(node.args[0]).rpartition(".")[2].strip("_")
                if asked in ("method", "program", "stepper"):
                    found.append(f"{path.relative_to(ROOT)}: {ast.unparse(node)}")
    # Which attribute a class states (`evaluations` of FixedStep), not whether a stranger's object has one.
    assert [one for one in found if "evaluations" not in one] == []


def test_a_capability_is_offered_where_all_its_members_are():
    pendulum = testing.pendulum().system
    assert offers(HBVM().compile(pendulum), Events)
    assert offers(Taylor().compile(pendulum), Events)
    assert not offers(Leapfrog(h=0.1).compile(pendulum), Events)

    class Half:
        def checkpoint(self):
            return None

    assert not offers(Half(), Checkpoints)


class Forgetful(FixedStep):
    """Symplectic Euler whose steppers have no checkpoints, as a third party's may be."""

    order = 1
    library = "tests"
    citation = "none"

    def march(self, system):
        def steps(t, h, first, n, y, par):
            import math

            for _ in range(n):
                y[1] -= h * math.sin(y[0])
                y[0] += h * y[1]

        return steps

    def compile(self, system):
        program = super().compile(system)
        start = program.start

        class Bare:
            """A stepper with nothing but the protocol."""

            def __init__(self, stepper):
                self._stepper = stepper

            t, y, status, reason, stats = (
                property(lambda self, name=name: getattr(self._stepper, name))
                for name in ("t", "y", "status", "reason", "stats")
            )

            def step(self):
                return self._stepper.step()

            def advance(self, times, *, sample=None):
                return self._stepper.advance(times, sample=sample)

        program.start = lambda y0, par=None, t0=0.0: Bare(start(y0, par, t0))
        return program


def test_a_stepper_with_nothing_but_the_protocol_conforms_and_integrates(tmp_path):
    method, problem = Forgetful(h=0.01), testing.pendulum()
    reasons = testing.check_method(method, problem)
    for name in ("checkpoints_continue_bit_for_bit", "refuses_other_checkpoints"):
        assert reasons[name] == "it has no checkpoints"
    whole = integrators.integrate(problem, method)
    assert whole.status == "finished"
    heard = []
    assert (integrators.integrate(problem, method, progress=heard.append).y == whole.y).all()
    assert heard
    with pytest.raises(InputError, match=r"Forgetful\(h=0.01\) has no checkpoints; leave out checkpoint="):
        integrators.integrate(problem, method, checkpoint=tmp_path / "kept")
    with pytest.raises(InputError, match="cannot find events"):
        integrators.integrate(problem, method, events=lambda q: q[0])


def test_an_integration_again_compiles_nothing_and_says_so():
    problem = testing.pendulum()
    for method in (HBVM(), Gauss(s=3, h=0.1), Taylor(), Leapfrog(h=0.1)):
        first, again = (integrators.integrate(problem, method) for _ in range(2))
        assert first.compile_seconds > 0.0 == again.compile_seconds
        assert again.from_cache is True or first.from_cache is None
        assert (first.y == again.y).all()


def test_a_system_keeps_its_last_programs_only():
    problem = testing.pendulum()
    for h in range(1, 20):
        integrators.integrate(problem, Gauss(s=2, h=0.1 / h), [1.0])
    assert len(problem.system._programs) == integrators.running.integrate.PROGRAMS
