"""Blocks of components, and the sizes that changes and errors of them are relative to."""

from integrators.kernel.native.memory import Array, Integer, Part


class Blocks(Part):
    """The blocks of a state, their groups (positions, momenta) and sizes; see `step.size`."""

    count = Integer()
    groups = Integer()
    of_row = Array(kind=int)  # the block of each row
    group = Array(kind=int)  # of each block
    weights = Array("padded", lasting=True)  # by row: 1 / size of its block
    floored_weights = Array("padded", lasting=True)  # the same, small blocks raised to a part of the largest
    size = Array("count")
    largest = Array("count")  # size in each group
    # How far the stages of a group are from the state, where a block is one component and all steps have one
    # length. The field of a component is a sum over others, and its rounding of the size of the largest's.
    farthest = Array("count")
    # Of each row of the field, the sum of its absolute terms in the previous step; 0: not known. A block is
    # at least what they would make of it in a step alone: what is left where they cancel is their rounding.
    terms = Array("padded", lasting=True)
    age = Integer(lasting=True)  # steps until sizes are taken anew
    # Velocity by momentum of a block, and the inverse; 1 in first-order form. Blocks compare as velocities:
    # a light body has small momenta, and is no less important.
    speed = Array("count")
    mass = Array("count")
