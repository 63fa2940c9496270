"""REBOUND's integrators: IAS15, WHFast, Leapfrog."""

from integrators.peers.rebound_fixed import Leapfrog, WHFast
from integrators.peers.rebound_ias15 import IAS15

__all__ = ["IAS15", "Leapfrog", "WHFast"]
