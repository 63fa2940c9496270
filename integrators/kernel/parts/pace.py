"""Reversible steps."""

from integrators.kernel.native.memory import Array, Integer, Part, Pointer, Real


class Pace(Part):
    """Reversible steps, of length `epsilon` / density; see `step.reversible`."""

    code = Pointer()  # `problems.targets.time_scale`, called like the field; 0: no such steps
    rows = Integer()
    parameters = Integer()
    par = Array("parameters")
    state = Array("rows", "lanes")
    values = Array(2, "lanes")
    times = Array("lanes")
    epsilon = Real(lasting=True)  # negative backwards
    log_density = Real(lasting=True)  # of the step ahead
    previous_log_density = Real(lasting=True)
    density_slope = Real(lasting=True)  # of the logarithm, in time, at the state
