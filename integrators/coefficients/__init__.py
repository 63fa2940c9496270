"""Numbers of Runge-Kutta methods: quadratures, polynomials, tableaux, order and stability."""
