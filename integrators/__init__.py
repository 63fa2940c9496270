"""HBVM and Gauss integrators, and the established libraries behind one stepper protocol.

``integrators.HBVM``, ``integrators.Gauss`` and every registered method
(``integrators.IAS15``, ...) are attributes, imported when first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import problems

if not hasattr(problems, "VectorField"):  # a file of the user
    raise ImportError(
        f"integrators needs hbvm-bench's package problems, but {problems.__file__} has that name; rename it."
    )

from integrators import registry
from integrators.protocol import MethodBase, Samples, Stats, Status
from integrators.running.integrate import integrate
from integrators.running.many import integrate_many
from integrators.running.run import Run, start
from integrators.running.watch import Progress
from integrators.solution.ensemble import Solutions, load
from integrators.solution.record import Solution

if TYPE_CHECKING:
    from integrators.coefficients.order import order_of as order_of
    from integrators.coefficients.order import stability as stability
    from integrators.dynamics import gradient as gradient
    from integrators.dynamics import lyapunov as lyapunov
    from integrators.dynamics import periodic as periodic
    from integrators.events import Event as Event
    from integrators.methods.advice import advise as advise
    from integrators.methods.gauss import Gauss as Gauss
    from integrators.methods.hbvm import HBVM as HBVM
    from integrators.methods.line_integral import LineIntegral as LineIntegral
    from integrators.peers.diffrax.methods import Dopri8 as Dopri8
    from integrators.peers.diffrax.methods import Kvaerno5 as Kvaerno5
    from integrators.peers.diffrax.methods import LeapfrogMidpoint as LeapfrogMidpoint
    from integrators.peers.diffrax.methods import ReversibleHeun as ReversibleHeun
    from integrators.peers.diffrax.methods import SemiImplicitEuler as SemiImplicitEuler
    from integrators.peers.diffrax.methods import Tsit5 as Tsit5
    from integrators.peers.heyoka.taylor import Taylor as Taylor
    from integrators.peers.pyhamsys import Composition as Composition
    from integrators.peers.pynamicalsys import ImplicitMidpoint as ImplicitMidpoint
    from integrators.peers.pynamicalsys import Yoshida4 as Yoshida4
    from integrators.peers.rebound import BS as BS
    from integrators.peers.rebound import EOS as EOS
    from integrators.peers.rebound import IAS15 as IAS15
    from integrators.peers.rebound import JANUS as JANUS
    from integrators.peers.rebound import MERCURIUS as MERCURIUS
    from integrators.peers.rebound import SABA as SABA
    from integrators.peers.rebound import TRACE as TRACE
    from integrators.peers.rebound import Leapfrog as Leapfrog
    from integrators.peers.rebound import WHFast as WHFast
    from integrators.peers.rebound import WHFast512 as WHFast512
    from integrators.peers.rebound.convert import from_rebound as from_rebound
    from integrators.peers.rebound.convert import to_rebound as to_rebound
    from integrators.peers.scipy import BDF as BDF
    from integrators.peers.scipy import DOP853 as DOP853
    from integrators.peers.scipy import LSODA as LSODA
    from integrators.peers.scipy import Radau as Radau
    from integrators.peers.sundials import CVODE as CVODE
    from integrators.running.poincare import section as section

__all__ = [
    "BDF",
    "BS",
    "CVODE",
    "DOP853",
    "EOS",
    "HBVM",
    "IAS15",
    "JANUS",
    "LSODA",
    "MERCURIUS",
    "SABA",
    "TRACE",
    "Composition",
    "Dopri8",
    "Event",
    "Gauss",
    "ImplicitMidpoint",
    "Kvaerno5",
    "Leapfrog",
    "LeapfrogMidpoint",
    "LineIntegral",
    "MethodBase",
    "Progress",
    "Radau",
    "ReversibleHeun",
    "Run",
    "Samples",
    "SemiImplicitEuler",
    "Solution",
    "Solutions",
    "Stats",
    "Status",
    "Taylor",
    "Tsit5",
    "WHFast",
    "WHFast512",
    "Yoshida4",
    "advise",
    "from_rebound",
    "gradient",
    "integrate",
    "integrate_many",
    "load",
    "lyapunov",
    "order_of",
    "periodic",
    "registry",
    "section",
    "stability",
    "start",
    "to_rebound",
]

_LATER = {  # imported when first used
    "from_rebound": "integrators.peers.rebound.convert",
    "to_rebound": "integrators.peers.rebound.convert",
    "Event": "integrators.events",
    "advise": "integrators.methods.advice",
    "gradient": "integrators.dynamics",
    "lyapunov": "integrators.dynamics",
    "order_of": "integrators.coefficients.order",
    "periodic": "integrators.dynamics",
    "section": "integrators.running.poincare",
    "stability": "integrators.coefficients.order",
}


def __getattr__(name: str) -> Any:
    if name in _LATER:
        return getattr(import_module(_LATER[name]), name)
    if name.startswith("_") or name not in registry.names():
        raise AttributeError(f"module 'integrators' has no attribute {name!r}")
    return registry.get(name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_LATER, *registry.names()})
