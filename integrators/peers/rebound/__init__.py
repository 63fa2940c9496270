"""REBOUND's integrators."""

from integrators.peers.rebound.bs import BS
from integrators.peers.rebound.eos import EOS
from integrators.peers.rebound.fixed import Leapfrog
from integrators.peers.rebound.hybrid import MERCURIUS, TRACE
from integrators.peers.rebound.ias15 import IAS15
from integrators.peers.rebound.janus import JANUS
from integrators.peers.rebound.saba import SABA
from integrators.peers.rebound.whfast import WHFast
from integrators.peers.rebound.whfast512 import WHFast512

__all__ = ["BS", "EOS", "IAS15", "JANUS", "MERCURIUS", "SABA", "TRACE", "Leapfrog", "WHFast", "WHFast512"]
