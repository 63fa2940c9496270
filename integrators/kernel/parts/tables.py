"""The method's coefficients, laid out for the products."""

from integrators.kernel.native.memory import Array, Integer, Part, Real


class Tables(Part):
    """Tables of coefficients, most of which trajectories share; see `integrators.kernel.tables`."""

    raw_matrix = Array()  # values -> stages (THROUGH: coefficients -> stages), for a step of 1
    matrix = Array(8, "matrix_size")  # the same for the step h
    matrix_size = Integer()  # in vectors of 8
    scaled_by = Real()  # the step that `step.begin.set_step` made it for
    # The previous step's values -> stages. Where steps vary, for a step of 1, for each of `tables.RATIOS`.
    extrapolation = Array()
    two_steps = Integer()  # whether first stages come from two steps
    extrapolation_two = Array()  # the values of the step before that one, and its own -> stages; route 8
    projection = Array()  # values -> coefficients
    groups = Integer()  # of 8 coefficients
    first = Integer()  # where gamma_0 is among them
    mode_projection = Array()  # values -> the coefficients that are extrapolated
    mode_groups = Integer()
    modes = Integer()
    most_groups = Integer()  # the larger of `groups` and `mode_groups`
    recurrence = Array()  # pairs a, b for P_{j+1} = a x P_j - b P_{j-1}
    nodes = Array()
    nodes_low = Array()
    weights = Array()
    weights_low = Array()
    position_weights = Array()
    position_weights_low = Array()
