"""Newton-type solvers for steps at which the fixed-point iteration does not contract."""
