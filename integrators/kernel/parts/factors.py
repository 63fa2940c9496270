"""What turns momenta into velocities."""

from integrators.kernel.native.memory import Array, Part


class Factors(Part):
    """The velocities by momentum in the second-order form, alone and times the step."""

    velocity = Array("padded")  # q' = velocity * p, by row
    row = Array("padded")  # h * velocity by row; 1 in first-order form
    drift = Array(2, "padded")  # the same in blocks [kh kh kh kh 0 0 0 0]
    kick = Array(2, "padded")  # and in blocks [1 1 1 1 kh kh kh kh]
