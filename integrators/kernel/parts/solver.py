"""The fixed-point iteration: how far it is, and when it ends."""

from integrators.kernel.native.memory import Integer, Part, Real


class Solver(Part):
    """The fixed-point iteration of the step ahead; see `step.iterate` and `step.stopping`."""

    outcome = Integer()
    predicted = Integer()  # 1: the start was extrapolated
    tried = Integer()  # iterations of this start
    tests = Integer()
    free = Integer()  # iterations without a test
    stalled = Integer()
    best = Real()  # the smallest change
    last = Real()  # change; see `step.iterate`
    change = Real()  # the largest of the last fused iteration
    rate = Real()  # binary logarithm of the iteration's contraction, as measured
    tolerance = Real()  # the relative change at which the iteration has converged
    trusted = Real()  # a change from which on adaptive steps iterate without a test,
    log_trusted = Real()  # and the binary logarithm of one before which they do
    stagnation = Real()  # a change above which one that stops decreasing is a failure
    log_residual = Real()  # binary logarithm of what may be left of a change when the step is solved
