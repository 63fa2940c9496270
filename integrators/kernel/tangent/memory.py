"""What tangent vectors keep in memory besides their contexts; see `integrators.kernel.native.memory`."""

from integrators.kernel.native.memory import Array, Backward, Integer, Memory, Pointers


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
