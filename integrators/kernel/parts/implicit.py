"""The implicit solver, and when it takes over from the fixed-point iteration."""

from integrators.kernel.native.memory import Array, Integer, Part, Pointer, Real

# Which nonlinear solver is used. AUTO: fixed point, and the implicit solver where that does not contract.
FIXED_POINT, AUTO, ALWAYS_IMPLICIT = range(3)
NOT_WANTED, FOR_STEPS, FOR_VECTORS = range(3)


class Implicit(Part):
    """The implicit solver beside the fixed-point iteration; see `step.solver_switch`."""

    strategy = Integer()  # FIXED_POINT, AUTO, ALWAYS_IMPLICIT
    code = Pointer()  # int64(context, memory, started); 0: not there yet
    memory = Pointer()
    active = Integer(lasting=True)  # 1: it is at work
    wanted = Integer()  # it should be, and is not there: FOR_STEPS, or only FOR_VECTORS that follow
    slow = Integer(lasting=True)  # steps in a row at which the fixed-point iteration was slow
    held = Integer(lasting=True)  # steps for which the implicit solver stays at work when it takes over
    left = Integer(lasting=True)  # steps of these that are left
    target_corrections = Real()  # corrections of an adaptive step to aim at, at most
    increment = Array()  # what it has found that the step adds to q, p or to y
