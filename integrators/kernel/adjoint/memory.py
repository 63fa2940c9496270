"""What recorded steps, and their adjoints, keep in memory; see `integrators.kernel.native.memory`."""

from integrators.kernel.native.memory import Array, Integer, Memory, Pointer

HEAD = 8  # doubles of a record before its stages: t0, time_low, n and h of its step, and room


class Tape(Memory):
    """Records of solved steps: for each `HEAD` doubles, the stages block by block, the state at its start."""

    capacity = Integer()
    count = Integer()
    size = Integer()  # doubles in a record
    records = Array("capacity", "size")
    full = Integer()  # 1: a step found no room


class Pullback(Memory):
    """A sequence of recorded steps, the last one first, that adjoints follow."""

    count = Integer()
    next = Integer()  # the first that is still to be followed
    heads = Array()  # `HEAD` doubles for each
    stages = Array()  # of each, the last stage first, as the rows that follow those of the adjoint
    states = Integer()  # how many
    slopes = Pointer()  # the products with derivatives by parameters; 0: not wanted
    parameters = Integer()
    values = Array("room")  # of these products, in one block of stages
    room = Integer()
    sums = Array("parameters")  # the derivatives by parameters,
    sums_low = Array("parameters")  # and what they lack
