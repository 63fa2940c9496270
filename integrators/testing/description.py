"""Checks of what a method says of itself: its class, its text, its options, what it accepts."""

import ast
import pickle
from typing import Any

from integrators import registry
from integrators.protocol import MethodBase
from integrators.testing.exercises import blow_up, pendulum, two_bodies
from integrators.testing.rules import raises, require
from problems import Problem
from problems.errors import UnknownNameError


def describes_itself(method: MethodBase, problem: Problem) -> str | None:
    """Check that the class has a library, a citation, a docstring; order is None or positive."""
    cls = type(method)
    require(
        bool(cls.library) and bool(cls.citation.strip()), f"{cls.__name__} names its library and citation"
    )
    # A dataclass without a docstring gets its signature as one: Name(*, option: type).
    doc = cls.__doc__ or ""
    require(bool(doc) and not doc.startswith(f"{cls.__name__}(*"), f"{cls.__name__} has a docstring")
    order = method.order
    require(
        order is None or (isinstance(order, int) and order >= 1), f"order is None or positive, not {order!r}"
    )
    return None


def is_a_value(method: MethodBase, problem: Problem) -> str | None:
    """Check that the method is frozen, comparable, hashable, picklable, and prints as its own call."""
    for name in method.options(defaults=True):
        try:
            setattr(method, name, None)
        except AttributeError:
            continue
        require(False, f"{method!r} is frozen; {name} could be set")
    name, options = _parse(repr(method))
    require(name == type(method).__name__, f"{method!r} prints its own name")
    twin = type(method)(**options)
    require(twin == method and hash(twin) == hash(method), f"{method!r} equals what its text makes")
    require(pickle.loads(pickle.dumps(method)) == method, f"{method!r} survives pickling")
    if name not in registry.names() or registry.get(name) is not type(method):
        return f"{name} is not registered under its own name"
    require(registry.create(name, **options) == method, f"the registry makes {method!r} from its text")
    return None


def refuses_unknown_options(method: MethodBase, problem: Problem) -> str | None:
    """Check that a wrong option name fails, by the class and by the registry."""
    name = type(method).__name__
    options = {**method.options(), "no_such_option": 1}
    raises(UnknownNameError, lambda: type(method)(**options), f"{name} refuses an unknown option")
    if name not in registry.names():
        return f"{name} is not registered"
    raises(UnknownNameError, lambda: registry.create(name, **options), f"the registry refuses it for {name}")
    return None


def accepts_gives_a_reason(method: MethodBase, problem: Problem) -> str | None:
    """Check that ``accepts`` returns None, or the reason as a sentence."""
    reason = method.accepts(problem)
    require(reason is None, f"{method!r} accepts the problem of the check, but says: {reason}")
    for other in (pendulum(), two_bodies(), blow_up()):
        reason = method.accepts(other)
        require(
            reason is None or (isinstance(reason, str) and len(reason) > 10),
            f"accepts gives a sentence, not {reason!r}",
        )
    return None


def _parse(text: str) -> tuple[str, dict[str, Any]]:
    """Read ``Name(option=literal, ...)`` without evaluating it."""
    call = ast.parse(text, mode="eval").body
    require(isinstance(call, ast.Call) and isinstance(call.func, ast.Name), f"{text} reads as one call")
    assert isinstance(call, ast.Call)
    assert isinstance(call.func, ast.Name)
    require(not call.args and all(k.arg for k in call.keywords), f"{text} has keyword arguments only")
    return call.func.id, {str(k.arg): ast.literal_eval(k.value) for k in call.keywords}
