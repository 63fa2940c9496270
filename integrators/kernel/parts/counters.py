"""What a trajectory has cost."""

from integrators.kernel.native.memory import Integer, Part


class Counters(Part):
    """Counters of a trajectory, which `integrators.protocol.Stats` reports."""

    steps = Integer()
    iterations = Integer()
    evaluations = Integer()
    restarts = Integer()
    partial_steps = Integer()
    partial_iterations = Integer()  # those of partial steps, which are among the iterations
    partial_evaluations = Integer()  # the same
    implicit_steps = Integer()
    switches = Integer()
    rejections = Integer()
