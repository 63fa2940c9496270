"""Where the last step began."""

from integrators.kernel.native.memory import Array, Integer, Part, Real


class Previous(Part):
    """The state before the previous step, to go back to; see `inside.discontinuities.undo`."""

    state = Array(2, "padded")
    error = Array(2, "padded")
    t0 = Real()
    time_low = Real()
    on_surface = Integer()  # `Surfaces.on_surface` there
