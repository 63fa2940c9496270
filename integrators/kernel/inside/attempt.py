"""What lies inside an attempted step of varying length: asked once before it, and once when it is solved."""

from integrators.kernel.context import DONE, SLIDING
from integrators.kernel.inside.discontinuities import has_discontinuity, record
from integrators.kernel.inside.filippov import slides
from integrators.kernel.inside.graze import grazes
from integrators.kernel.inside.surfaces import AGAIN, REACHED, leave, locate, look_across
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.discontinuities import NOTHING
from integrators.kernel.parts.surfaces import END_ACROSS, NO_SURFACE
from integrators.kernel.step.begin import INFINITY
from integrators.kernel.step.control import is_good
from integrators.kernel.step.estimate import estimate, estimate_implicit

# What comes of an attempt besides AGAIN and REACHED: it is good enough; its errors are too large, or it
# crosses what it must not; it is longer than one may be whose field has the same value at all nodes.
GOOD, BAD, TOO_LONG = range(REACHED + 1, REACHED + 4)

# A step that is too long may fail, or look like one with a discontinuity; so many in a row have one, and are
# cut to find it.
CONFIRMATIONS = 3


@compiled
def enter(ctx):
    """Let the step ahead begin beyond a surface that the trajectory is on; the outcome."""
    # Its first stages are on one side only if they are beyond the surface; what follows from the state
    # alone may be on either.
    if ctx.surfaces.on_surface and ctx.length == 0.0:
        if ctx.surfaces.locating + ctx.controller.attempts == 0 and slides(ctx):
            return SLIDING
        leave(ctx)
    return DONE


@compiled
def judge_attempt(ctx, outcome, implicit):
    """Return the estimated errors of the attempted step, and what comes of it.

    The errors are infinite where it failed, or is not smooth.

    Parameters
    ----------
    ctx : Context
    outcome : int
        How its equations were solved.
    implicit : int
        Whether the implicit solver did it.
    """
    discontinuities, surfaces, controller = ctx.discontinuities, ctx.surfaces, ctx.controller
    discontinuities.undone = 0
    across = look_across(ctx, outcome) if surfaces.code else NO_SURFACE
    error, quadrature_error, fits = INFINITY, INFINITY, False
    if outcome == DONE:
        surfaces.crossed = 1 if across >= 0 or (across == END_ACROSS and surfaces.locating == 0) else 0
        error, quadrature_error = estimate_implicit(ctx) if implicit else estimate(ctx)
        fits = is_good(error, controller.allowed_error, quadrature_error, controller.allowed_quadrature_error)
        if breaks(ctx, fits, implicit) or (surfaces.count and fits and across == NO_SURFACE and touches(ctx)):
            error, fits = INFINITY, False
        if ctx.estimate.constant_field and abs(ctx.h) > controller.longest_constant:
            return error, quadrature_error, TOO_LONG
    if surfaces.code and (surfaces.locating or (across != NO_SURFACE and not fits)):
        verdict = locate(ctx, outcome, fits)
        if verdict in (AGAIN, REACHED):
            return error, quadrature_error, verdict
        surfaces.locating = 0
        if across != NO_SURFACE:
            record(ctx, ctx.t0, ctx.h)
            fits = False
    return error, quadrature_error, GOOD if fits else BAD


@compiled
def breaks(ctx, fits, implicit):
    """Whether the solved step has a discontinuity that matters."""
    discontinuities = ctx.discontinuities
    if implicit:
        looks = ctx.surfaces.crossed and (discontinuities.not_smooth or fits)
        found = looks and has_discontinuity(ctx, fits)
        discontinuities.next_boundary = NOTHING
        discontinuities.undone = 0
        return found
    if discontinuities.not_smooth:
        discontinuities.doubts += 1
        discontinuities.doubt_end = ctx.t0 + ctx.h
    return (fits or discontinuities.doubts >= CONFIRMATIONS) and has_discontinuity(ctx, fits)


@compiled
def touches(ctx):
    """Whether the solved step touches a surface between its nodes; record that."""
    if not grazes(ctx):
        return False
    record(ctx, ctx.t0, ctx.h)
    return True
