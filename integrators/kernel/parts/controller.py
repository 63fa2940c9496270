"""The lengths of adaptive steps."""

from integrators.kernel.native.memory import Integer, Part, Real


class Controller(Part):
    """The lengths of adaptive steps, and what they follow from; see `trajectory.vary` and `step.control`."""

    allowed_error = Real()  # the estimated local error of a step, relative, at most
    allowed_quadrature_error = Real()  # the same of the quadrature; infinite: any
    error_degree = Integer()  # of the Legendre coefficient that the error is estimated by
    error_aim = Real()  # logarithm of the error to aim at, divided by its order
    quadrature_error_aim = Real()
    # Logarithm of the last step's estimated error, divided by its order ...
    previous_error = Real(lasting=True)
    error_ahead = Real(lasting=True)  # ... and of that of the step that is solved
    previous_quadrature_error = Real(lasting=True)  # the same for the quadrature error
    quadrature_error_ahead = Real(lasting=True)
    previous_length = Real(lasting=True)  # of the last step; 0: unknown
    next_length = Real(lasting=True)  # of the next step to be tried
    length_after = Real(lasting=True)  # of the one after the step that is solved
    length_limit = Real(lasting=True)  # no step is longer, for what the iteration allows
    longest = Real()  # no step is longer, for what the user allows and the interval
    longest_constant = Real()  # the same where the field has the same value at all nodes of a step
    interval = Real(lasting=True)  # length of all that is integrated, from the trajectory's start; 0: unknown
    stop = Real()  # no step passes this time; infinite: none
    breaks = Integer()  # 1: `stop` is a time at which the field may jump,
    resolution = Real()  # as far from there as this by rounding
    attempts = Integer()  # at the step ahead that were rejected
    rejected = Integer()  # 1: `Context.values` are of a rejected step of `length`, from the present state
    no_time_scale = Integer(lasting=True)  # 1: the field at the start tells no time scale
