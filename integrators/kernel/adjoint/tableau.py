"""The tableau of the adjoint of HBVM(k, s)."""

from dataclasses import replace
from functools import lru_cache

from integrators.kernel.routes import THROUGH
from integrators.kernel.tables import Constants
from problems.double_double import DD


@lru_cache(maxsize=64)
def adjoint(constants: Constants) -> Constants:
    """Return the tables of the method that the adjoints of the steps take, in first-order form.

    Its matrix is ``b_j a_ji / b_i``, with the stages numbered from the last to the first. For k = s that is
    the method itself (J. M. Sanz-Serna, SIAM Review 58 (2016), 3-33). For k > s it is another one, of order
    2s as well: ``b_j a_ji / b_i = sum_m P_m(c_i) b_j int_0^{c_j} P_m``.
    """
    if constants.k == constants.s:
        return constants
    a = constants.arrays
    weights = DD(a["weights"], a["weights_low"])[::-1]  # (k, 1), the last stage's first
    if constants.route == THROUGH:
        integrals = DD(a["matrix"], a["matrix_low"])[::-1]
        columns, rows = DD(a["projection"].T[::-1]) / weights, weights * integrals
        changed = {"matrix": columns.hi, "matrix_low": columns.lo, "projection": rows.rounded().T}
    else:
        matrix = DD(a["matrix"].T, a["matrix_low"].T)[::-1, ::-1] / weights * DD(weights.hi.T, weights.lo.T)
        changed = {"matrix": matrix.hi, "matrix_low": matrix.lo}
    return replace(constants, arrays={**a, **changed})
