"""Surfaces at which the field switches."""

from integrators.kernel.native.memory import Array, Integer, Part, Pointer, Real

MOST_SURFACES = 16  # whose distances have a row of their own
MOST_SIDES = 1 + MOST_SURFACES  # rows of what tells the sides of switching surfaces

# Where a solved step crosses a switching surface, besides at a node: after the last one; nowhere.
END_ACROSS, NO_SURFACE = -1, -2

# A state on a switching surface: at the end of a step; at the start of the trajectory.
AT_STEP_END, AT_ORIGIN = 1, 2


class Surfaces(Part):
    """Switching surfaces, and the steps that end on them; see `inside.surfaces`."""

    code = Pointer()  # `problems.analysis.sides`, called like the field; 0: no such surfaces
    count = Integer()  # how many distances it has besides: rows after the first
    values = Array("calls", MOST_SIDES, "lanes")  # its values at the stages,
    ends = Array(MOST_SIDES, "lanes")  # at the start, then at the end of the step,
    between = Array(MOST_SIDES, "lanes")  # and between two nodes
    times = Array("lanes")
    state = Array(2, "padded")  # a state there
    crossed = Integer()  # 1: a switching surface lies in the step that was attempted
    across = Integer()  # the first node beyond one, or END_ACROSS, or NO_SURFACE
    locating = Integer()  # attempts at the step ahead to end it there; 0: none
    near = Real()  # length of the longest of them that crosses none, and
    far = Real()  # of the shortest that does
    distance = Real()  # from the end of the last one to the surface, in parts of it; infinite: none yet
    row = Integer(lasting=True)  # of the distance that vanishes there; 0: unknown
    length_wanted = Real(lasting=True)  # of the step ahead, before that
    reached = Integer(lasting=True)  # 1: the step that is solved ends on a surface
    on_surface = Integer(lasting=True)  # the present state is on one: AT_STEP_END, AT_ORIGIN; 0: it is not
