"""Where the last step began."""

from integrators.kernel.native.memory import Array, Integer, Part, Real


class Previous(Part):
    """The state before the previous step, to go back to; see `inside.discontinuities.undo`."""

    state = Array(2, "padded", lasting=True)
    error = Array(2, "padded", lasting=True)
    t0 = Real(lasting=True)
    time_low = Real(lasting=True)
    on_surface = Integer(lasting=True)  # `Surfaces.on_surface` there
