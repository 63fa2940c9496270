"""The fixed-point iteration: how far it is, and when it ends."""

from integrators.kernel.native.memory import Integer, Part, Real


class Solver(Part):
    """The fixed-point iteration of the step ahead; see `step.iterate` and `step.stopping`."""

    outcome = Integer()
    predicted = Integer()  # 1: the start was extrapolated
    tried = Integer()  # iterations of this start
    tests = Integer()
    free = Integer(lasting=True)  # iterations without a test
    stalled = Integer()
    best = Real()  # the smallest change
    last = Real()  # change; see `step.iterate`
    change = Real()  # the largest of the last fused iteration
    rate = Real(lasting=True)  # binary logarithm of the iteration's contraction, as measured
    tolerance = Real(lasting=True)  # the relative change at which the iteration has converged
    trusted = Real(lasting=True)  # a change from which on adaptive steps iterate without a test,
    log_trusted = Real(lasting=True)  # and the binary logarithm of one before which they do
    stagnation = Real(lasting=True)  # a change above which one that stops decreasing is a failure
    # Binary logarithm of what may be left of a change when the step is solved
    log_residual = Real(lasting=True)
