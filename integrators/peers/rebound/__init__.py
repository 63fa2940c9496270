"""REBOUND's integrators: IAS15, WHFast, WHFast512, Leapfrog."""

from integrators.peers.rebound.fixed import Leapfrog
from integrators.peers.rebound.ias15 import IAS15
from integrators.peers.rebound.whfast import WHFast
from integrators.peers.rebound.whfast512 import WHFast512

__all__ = ["IAS15", "Leapfrog", "WHFast", "WHFast512"]
