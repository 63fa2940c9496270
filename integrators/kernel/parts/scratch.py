"""Room for what a step makes on its way."""

from integrators.kernel.native.memory import Array, Part

STAGE = ("calls", "padded", "lanes")  # shape of stage memory


class Scratch(Part):
    """What a step makes on its way; nothing of it is needed by the next one."""

    old_stages = Array(*STAGE)  # before the last product, where changes are measured
    base = Array(*STAGE)  # what a stage has besides the state and the forces
    sums = Array(*STAGE)
    coefficients = Array(8, "tables.most_groups", "padded")
    basis = Array(64, "chunks", "tables.most_groups")  # a table made on the way
    row_state = Array("padded")
    row_error = Array("padded")
    row_drift = Array("padded")  # h q'
    row_drift_low = Array("padded")
