"""HBVM and Gauss integrators, and the established libraries behind one stepper protocol.

``integrators.HBVM``, ``integrators.Gauss`` and every registered method
(``integrators.IAS15``, ...) are attributes, imported when first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from integrators import registry
from integrators.integrate import integrate
from integrators.many import Solutions, integrate_many
from integrators.protocol import MethodBase, Samples, Stats, Status
from integrators.solution import Solution, load
from integrators.watch import Progress

if TYPE_CHECKING:
    from integrators.advice import advise as advise
    from integrators.events import Event as Event
    from integrators.gauss import Gauss as Gauss
    from integrators.hbvm import HBVM as HBVM
    from integrators.order import order_of as order_of
    from integrators.order import stability as stability
    from integrators.poincare import section as section

__all__ = [
    "MethodBase",
    "Progress",
    "Samples",
    "Solution",
    "Solutions",
    "Stats",
    "Status",
    "integrate",
    "integrate_many",
    "load",
    "registry",
]

_LATER = {  # imported when first used
    "Event": "integrators.events",
    "advise": "integrators.advice",
    "order_of": "integrators.order",
    "section": "integrators.poincare",
    "stability": "integrators.order",
}


def __getattr__(name: str) -> Any:
    if name in _LATER:
        return getattr(import_module(_LATER[name]), name)
    if name.startswith("_") or name not in registry.names():
        raise AttributeError(f"module 'integrators' has no attribute {name!r}")
    return registry.get(name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_LATER, *registry.names()})
