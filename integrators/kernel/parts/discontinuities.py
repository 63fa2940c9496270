"""Places where the field is not smooth."""

from integrators.kernel.native.memory import Array, Integer, Part, Real

MOST_RECORDED = 64

# What is known of the field where a step ends: NOTHING; the values that its polynomial says, EXTRAPOLATED,
# which are compared with those of the next; that they are right, SEEN. At a START it may jump, as far from
# there as `Discontinuities.resolution` by rounding.
START, NOTHING, EXTRAPOLATED, SEEN = range(-1, 3)


class Discontinuities(Part):
    """Jumps of the field and of its derivatives that steps have met; see `inside.discontinuities`."""

    doubts = Integer()  # attempts at the step ahead that were rejected and did not look smooth
    doubt = Real()  # last coefficients that are a smaller part of the low ones fall off well enough
    slowest_decay = Real()  # of a smooth field, from the middle coefficients to the last ones
    negligible = Real()  # part of a block's size that the error at a discontinuity may be
    not_smooth = Integer()  # 1: in the step that was estimated the field does not look smooth
    count = Integer(lasting=True)  # places where steps were rejected for that
    # Pairs: time and length of the last step rejected at each of them
    records = Array(2, MOST_RECORDED, lasting=True)
    end = Real(lasting=True)  # where the first such step at the last place would have ended
    # Where the last step would have ended that failed or looked like one with a discontinuity
    doubt_end = Real(lasting=True)
    # The field where steps meet, which no node sees. At the end of the step ahead, as its polynomial says,
    # eight partial sums a row; the same of the previous step.
    boundary_values = Array(8, "padded", lasting=True)
    previous_boundary_values = Array(8, "padded", lasting=True)
    gaps = Array("rows")  # how far that is from what the polynomial of the step ahead says
    apart = Integer()  # 1: for one of them that is more than for a smooth field
    last_coefficients = Array("rows", lasting=True)  # the larger of the last two coefficients of a row,
    previous_last_coefficients = Array("rows", lasting=True)  # and in the previous step
    boundary = Integer(lasting=True)  # what is known of the previous step: START, NOTHING, EXTRAPOLATED, SEEN
    next_boundary = Integer(lasting=True)  # the same of the step ahead
    resolution = Real(lasting=True)  # of the time of a START
    undone = Integer()  # 1: the field jumps before the end of the previous step
