"""The projection onto the energy."""

from integrators.kernel.native.memory import Array, Integer, Part, Pointer, Real


class Energy(Part):
    """The energy that steps end with; see `step.projection`."""

    # What writes the gradient of the energy and then the energy itself, called like the field with
    # eight stages; 0: no projection
    code = Pointer()
    start = Real(lasting=True)  # the energy of the start, which steps end with,
    scale = Real(lasting=True)  # and the inverse of how much of it the components make there
    rows = Integer()  # of what it writes: one more than the state has; 0: no projection
    width = Integer()  # components of a block of the state
    state_indices = Array(kind=int)  # where the components of (q, p) or y are in the state
    state = Array("rows", 8)
    outputs = Array("rows", 8)
