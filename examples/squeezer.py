"""Andrews' squeezer mechanism: seven bodies in three closed loops, driven by a constant torque.

The equations and constants of W. Schiehlen (ed.), Multibody Systems Handbook, Springer 1990, as they stand in
E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section VII.7, and in the Test Set for IVP
Solvers (F. Mazzia, C. Magherini, University of Bari), with its reference solution at t = 0.03. There it is a
system of index 3 of 27 equations; here an energy, six constraints and no option of the method.
"""

import numpy as np

from integrators import DOP853, HBVM, integrate
from problems import Constrained, Lagrangian, Problem

M1, M2, M3, M4, M5, M6, M7 = 0.04325, 0.00365, 0.02373, 0.00706, 0.0705, 0.00706, 0.05498
I1, I2, I3, I4, I5, I6, I7 = 2.194e-6, 4.41e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5
A, B, C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)
STIFFNESS, RELAXED, TORQUE = 4530.0, 0.07785, 0.033
D, DA, E, EA, RR, RA, SS, SA = 0.028, 0.0115, 0.02, 0.01421, 0.007, 0.00092, 0.035, 0.01874
SB, SC, SD, TA, TB, U, UA, UB = 0.01043, 0.018, 0.02, 0.02308, 0.00916, 0.04, 0.01228, 0.00449
ZF, ZT, FA = 0.02, 0.04, 0.01421
START = [  # the angles beta, Theta, gamma, Phi, delta, Omega, epsilon
    -0.0617138900142764496, 0.0, 0.455279819163070380, 0.222668390165885885, 0.487364979543842550,
    -0.222668390165885885, 1.23054744454982119,
]  # fmt: skip
END = [
    15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948, 0.5244099658805304,
    0.5347301163226948, 1.048080741042263,
]  # fmt: skip


def lagrangian(q, v, m):
    """Return the kinetic energy less that of the spring and of the torque."""
    theta, phi, omega = q[1], q[3], q[5]
    along, across = E - EA, ZF - FA
    mass = {
        (0, 0): M1 * RA**2 + M2 * (RR**2 - 2 * DA * RR * m.cos(theta) + DA**2) + I1 + I2,
        (1, 0): M2 * (DA**2 - DA * RR * m.cos(theta)) + I2,
        (1, 1): M2 * DA**2 + I2,
        (2, 2): M3 * (SA**2 + SB**2) + I3,
        (3, 3): M4 * along**2 + I4,
        (4, 3): M4 * (along**2 + ZT * along * m.sin(phi)) + I4,
        (4, 4): M4 * (ZT**2 + 2 * ZT * along * m.sin(phi) + along**2) + M5 * (TA**2 + TB**2) + I4 + I5,
        (5, 5): M6 * across**2 + I6,
        (6, 5): M6 * (across**2 - U * across * m.sin(omega)) + I6,
        (6, 6): M6 * (across**2 - 2 * U * across * m.sin(omega) + U**2) + M7 * (UA**2 + UB**2) + I6 + I7,
    }
    kinetic = sum(value * v[i] * v[j] * (0.5 if i == j else 1.0) for (i, j), value in mass.items())
    x = SD * m.cos(q[2]) + SC * m.sin(q[2]) + B[0] - C[0]
    y = SD * m.sin(q[2]) - SC * m.cos(q[2]) + B[1] - C[1]
    return kinetic - STIFFNESS * (m.sqrt(x**2 + y**2) - RELAXED) ** 2 / 2 + TORQUE * q[0]


def loops(q, m):
    """Return what the three loops are open by, in x and y."""
    x = RR * m.cos(q[0]) - D * m.cos(q[0] + q[1])
    y = RR * m.sin(q[0]) - D * m.sin(q[0] + q[1])
    return [
        x - SS * m.sin(q[2]) - B[0],
        y + SS * m.cos(q[2]) - B[1],
        x - E * m.sin(q[3] + q[4]) - ZT * m.cos(q[4]) - A[0],
        y + E * m.cos(q[3] + q[4]) - ZT * m.sin(q[4]) - A[1],
        x - ZF * m.cos(q[5] + q[6]) - U * m.sin(q[6]) - A[0],
        y - ZF * m.sin(q[5] + q[6]) + U * m.cos(q[6]) - A[1],
    ]


def main() -> None:
    """Print errors beside the reference solution."""
    system = Constrained(Lagrangian(lagrangian, dof=7), constraints=[loops], name="squeezer")
    problem = Problem(system, q0=START, v0=[0.0] * 7, t_end=0.03, project=True)
    for method in (HBVM(), HBVM(tol=1e-8), DOP853(rtol=1e-12, atol=1e-14)):
        solution = integrate(problem, method, np.linspace(0.0, 0.03, 31)[1:])
        apart = np.abs(solution.q[-1] / END - 1.0).max()
        errors = {name: f"{error.max():.0e}" for name, error in solution.errors().items()}
        print(f"{method!r}: {solution.stats.steps} steps, from the reference {apart:.0e}, {errors}")
        if method == HBVM():
            kept = max(error.max() for error in solution.errors().values()) < 1e-14
            near = apart < 1e-9  # the reference's own error
    print("energy and loops at round-off:", kept)
    print("the published solution to nine digits:", near)


if __name__ == "__main__":
    main()
