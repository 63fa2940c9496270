"""What the error of a step is estimated by."""

from integrators.kernel.native.memory import Array, Integer, Part, Real

# Legendre coefficients of the field that a step is judged by: gamma_0 .. gamma_3, that before and that of
# `Controller.error_degree`, the last two that k nodes see, two from the middle. Then the field at a step's
# ends.
GAMMA_0, GAMMA_1, GAMMA_2, GAMMA_3, BEFORE_ERROR, AT_ERROR, BEFORE_LAST, LAST = range(8)
MIDDLE, AFTER_MIDDLE, AT_START, AT_END = range(8, 12)

TOO_NOISY = 2


class Estimate(Part):
    """The estimated errors of a step, block by block; see `step.estimate`."""

    estimators = Array()  # b_l P_j(c_l), a row for each of GAMMA_0 .. AT_END
    coefficients = Array(8, "rows")  # GAMMA_0 .. LAST of the field, row by row
    scale = Array("blocks.count")  # of blocks: their size in the step that is estimated,
    slope = Array("blocks.count")  # the largest coefficient of their field,
    gamma_error = Array("blocks.count")  # gamma_s, which the error is estimated by,
    gamma_last = Array("blocks.count")  # gamma_{k-1}, which the quadrature error is estimated by,
    slow_decay = Array("blocks.count")  # and the largest that does not fall off as a smooth field's do
    fastest = Array("blocks.count")  # scale in each group, as a velocity,
    steepest = Array("blocks.count")  # and slope
    noise = Array("blocks.count", lasting=True)  # coefficients that rounding explains; see `step.rounding`
    # The largest size, as a velocity, that a block of each group has had
    largest = Array("blocks.groups", lasting=True)
    line = Real()  # part of a step on which noise is measured; 0: it is not
    # 1: the field is a function that is called, and may have more noise than rounding makes in a formula.
    called = Integer()
    # 1: it has, and that is in `noise`; TOO_NOISY: more than the tolerance allows
    noisy = Integer(lasting=True)
    troubles = Integer(lasting=True)  # steps that were rejected or shortened,
    next_look = Integer(lasting=True)  # and how many of them there are when noise is looked for again
    spacing = Real(lasting=True)  # of differences beside a component, relative, where that is noise
    measured = Integer()  # 1: noise was measured in the step that was estimated
    evident_error = Real()  # the estimated errors, of what is more than rounding in any field
    evident_quadrature_error = Real()
    least_slope = Real()  # of a block's field beside the largest in its group, where errors are estimated
    error_decay = Real()  # of coefficients from one degree to the next, where the error is allowed
    quadrature_error_decay = Real()  # the same where the quadrature error is
    absolute = Array("blocks.count")  # the absolute tolerance of blocks, divided by the relative one
    # The largest size that blocks will reach, as far as is known
    expected = Array("blocks.count", lasting=True)
    # > 0: errors are relative to that where it is larger than a block's own size
    rescaled = Integer(lasting=True)
    # 1: by their own sizes alone the step that was estimated is not good enough
    borrowed = Integer(lasting=True)
    # 1: what blocks will reach can be asked for, by UNSCALED; -n: after n steps again; 0: never
    asks = Integer(lasting=True)
    # 1: the field has the same value at all nodes of the step that was estimated
    constant_field = Integer(lasting=True)
