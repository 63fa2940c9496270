"""What tangent vectors keep in memory besides their contexts; see `integrators.kernel.native.memory`."""

from integrators.kernel.native.memory import Array, Backward, Integer, Memory, Pointer, Pointers, Real


class Tangents(Memory):
    """The vectors along one trajectory, in groups that one function differentiates the field for.

    The vectors of a group are a trajectory themselves: those of `Context.rows` of the trajectory, one vector
    after another, are the rows of their context.
    """

    trajectory = Backward()  # its context
    dim = Integer()  # of the trajectory's state
    rows = Integer()  # components of one of its stages
    count = Integer()  # vectors
    groups = Integer()
    own = Pointers()  # the groups' contexts,
    partial = Pointers()  # those for partial steps,
    pulls = Pointers()  # and the relative derivatives of velocities, by row; 0: none
    vectors = Array("groups", kind=int)  # in each group
    room = Array("room_size")  # for the state of a group
    room_size = Integer()
    out = Array()  # where samples are written to, as (sample, dim, count)
    failed = Integer()  # 1: the equations of a step were not solved


TOO_FAR_APART, TOO_LONG = 32, 33
"""Outcomes of a round that is to be repeated: the vectors' sizes; an error of a vector by a step."""


class Frame(Memory):
    """Tangent vectors that are made orthonormal after each round of steps, and what they have grown by.

    Intervals of time follow each other; a round ends where growth asks for it, and at the end of each.
    """

    trajectory = Pointer()  # its context,
    partial = Pointer()  # that of its partial steps,
    tangents = Pointer()  # `Tangents`,
    steps = Pointer()  # and the code of its steps
    dim = Integer()  # of the trajectory's state
    count = Integer()  # vectors
    intervals = Integer()
    interval = Integer()  # the present one
    marks = Array()  # where intervals end
    targets = Array(kind=int)  # the last step in each, where all have one length
    stop = Real()  # no step passes this time; infinite: none
    ends = Array()  # the end of the last step in each interval
    end_states = Array()  # and the trajectory's state there, (interval, dim)
    growth = Array()  # the logarithms of R's diagonal, added up in each interval, (interval, count),
    growth_low = Array()  # and what these sums have lost
    divergence = Array()  # the integral of the divergence over each interval,
    divergence_low = Array()  # and what it has lost
    has_divergence = Integer()  # 1: it is computed, from as many vectors as components
    vectors = Array("count", "dim")  # one after another
    sizes = Array("count")  # the logarithms of R's diagonal in the last round
    stages = Array("dim", "dim")  # of all vectors at a stage: rows are components
    slopes = Array("dim", "dim")  # the same of the field along them
    times = Pointer()  # what one step is asked for, and tells: two times,
    states = Pointer()  # two states,
    step_targets = Pointer()  # the step with fixed step size,
    parts = Pointer()  # and what is beyond it: nothing
    wanted = Integer()  # steps of the present round,
    most = Integer()  # at most so many,
    taken = Integer()  # and those it has
    budget = Integer()  # steps after which to come back
    rounds_left = Integer()  # and rounds
    rounds = Integer()  # so far
    extent = Real()  # how far sizes of the last round were apart
    error = Real()  # the largest relative error of a vector by its last step, estimated; 0: unknown
    longest = Real()  # of the steps, for what the user allows
