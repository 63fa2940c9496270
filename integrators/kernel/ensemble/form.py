"""What the code of steps in lanes depends on besides the field and their number: constants, once linked."""

from integrators.kernel.native.memory import Integer, Memory, Part, Within


class Blocks(Part):
    """Groups of blocks of a stage, which follow one another, and all are the same."""

    first = Integer()  # row
    groups = Integer()  # 0: none
    count = Integer()  # of blocks in a group
    width = Integer()  # of a block


class Form(Memory):
    """Numbers that are the same in all steps, by which the code is specialized."""

    k = Integer()  # stages
    rows = Integer()  # components of a stage
    second = Integer()  # 1: second-order form; stages hold positions, the state is (q, p)
    unit = Integer()  # 1: the rows' factors h q' / p are in the matrix
    # 1: every lane has a step of its own length. The matrix is that of a step of 1, the end of the step goes
    # to `Group.next_state`, and a lane whose equations are not solved is not alive then.
    varying = Integer()
    unrolled = Integer()  # 1: stages and rows are unrolled; see `ensemble.prepared.unrolled_for`
    held = Integer()  # 1: the field's values are then in registers from step to step
    blocks = Within(Blocks)  # positions and momenta
    vectors = Within(Blocks)  # of tangent vectors: they are measured after each iteration
    # Degrees of the Legendre coefficients that such a step is judged by; see `tables.degrees_judged`
    gamma_0 = Integer()
    gamma_1 = Integer()
    gamma_2 = Integer()
    gamma_3 = Integer()
    before_error = Integer()
    at_error = Integer()
    before_last = Integer()
    last = Integer()


JUDGED = tuple(Form.slots)[-8:]
"""Names of the degrees that steps are judged by, in their order."""
