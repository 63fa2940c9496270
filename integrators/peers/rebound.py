"""REBOUND's integrators: IAS15, WHFast, WHFast512, Leapfrog."""

from integrators.peers.rebound_fixed import Leapfrog, WHFast
from integrators.peers.rebound_ias15 import IAS15
from integrators.peers.rebound_whfast512 import WHFast512

__all__ = ["IAS15", "Leapfrog", "WHFast", "WHFast512"]
