"""Transcendental functions on lanes: one lane after another through the C library."""

import math

from integrators.kernel.lanes import Lanes, intrinsic_call, register

for _function, _name in (
    (math.sin, "sin"),
    (math.cos, "cos"),
    (math.tan, "tan"),
    (math.exp, "exp"),
    (math.log, "log"),
):
    register(_function, 1, Lanes, intrinsic_call(_name))
