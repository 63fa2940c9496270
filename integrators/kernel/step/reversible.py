r"""Adaptive steps that are the same backwards.

The density rho of the steps follows the rate w of the field (`targets.time_scale`), (log rho)' = w'/w:

    log rho_{n+1/2} - log rho_{n-1/2} = epsilon (w'/w)(y_n) / ((rho_{n-1/2} + rho_{n+1/2})/2),
    h_{n+1/2} = epsilon / rho_{n+1/2},     log rho_{1/2} = log w(y_0) + (epsilon/2) (w'/w^2)(y_0).

This is the integrating controller of E. Hairer, G. Söderlind, SIAM J. Sci. Comput. 26 (2005) 1838-1851, for
the logarithm: theirs is ``rho_{n+1/2} - rho_{n-1/2} = epsilon w'/w``, where an error that is small at a close
encounter is large far from it, and the density may become negative. The equation for ``rho_{n+1/2}`` has
one solution. With a symmetric method, going back from y_n repeats the steps, but for rounding, so that
in reversible systems the energy does not drift as it does with ordinary adaptive steps.
"""

from math import exp, log

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_field
from integrators.kernel.step.stages import place

NEWTON = 8  # iterations; 4 suffice for growth by factors of 1/3 to 3


@compiled
def find_slope(ctx):
    """Set what the logarithm of the density grows by at the state; return the field's rate there."""
    pace = ctx.pace
    state, lanes, values = pace.state, ctx.lanes, pace.values
    for d in range(pace.rows):
        for lane in range(lanes):
            state[lanes * d + lane] = ctx.state[place(ctx, d)]
    call_field(pace.code, pace.times, state, pace.par, values)
    pace.density_slope = values[lanes]
    return values[0] ** 0.25


@compiled
def growth(c):
    """Return the solution x of x (exp(x) + 1) = c, by Newton's method."""
    x = log(1.0 + 0.5 * c) if c > 0.0 else c
    for _ in range(NEWTON):
        e = exp(x)
        x -= (x * (e + 1.0) - c) / (e * (1.0 + x) + 1.0)
    return x


@compiled
def set_pace(ctx, previous, ahead):
    """Set the logarithms of the densities of the previous step and of that ahead, and its length."""
    pace = ctx.pace
    pace.previous_log_density, pace.log_density = previous, ahead
    ctx.controller.next_length = pace.epsilon * exp(-ahead)


@compiled
def begin_pace(ctx):
    """Set the density of the first step, and its length."""
    rate = find_slope(ctx)
    half = 0.5 * ctx.pace.epsilon * ctx.pace.density_slope / rate
    set_pace(ctx, log(rate) - half, log(rate) + half)
    ctx.controller.no_time_scale = 0


@compiled
def keep_pace(ctx):
    """Set the density of the next step after one is taken, and its length."""
    pace = ctx.pace
    find_slope(ctx)
    previous = pace.log_density
    set_pace(ctx, previous, previous + growth(2.0 * pace.epsilon * pace.density_slope * exp(-previous)))
