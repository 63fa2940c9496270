"""The compiled functions of the kernel in this process, by the modules that they are written in.

What takes time, importing numba and such a module, is done only where one has to be compiled.
"""

from integrators.kernel.native.around import Around
from integrators.kernel.native.engine import Engine

steps = Engine(
    "trajectory.entry", "entry", "operation ctx partial between count times targets parts first out budget"
)
"""``steps(what, ctx, ...)``: see `integrators.kernel.trajectory.entry`."""

iterations = Around("step.fused", "iterations", "context count after")
"""Whole iterations, for forms (lanes, rows, by columns); see `integrators.kernel.step.fused`."""

solver = Engine("implicit.entry", "entry", "ctx memory started")
"""The implicit solver; its address is what `integrators.kernel.step.solver_switch` calls."""

triangular = Engine(
    "implicit.triangular",
    "entry",
    "n lower_starts lower_columns lower upper_starts upper_columns upper sources targets vectors scratch",
)
"""Solve with sparse factors; see `integrators.kernel.implicit.triangular`."""

work = Engine("step.work", "work", "team helper")
"""Pieces of the jobs of a team of threads; its address is what `integrators.kernel.step.share` calls."""

line = Engine("line.entry", "entry", "operation ctx")
"""Line integrals; its address is what the steps call where there is a `Context.line`."""

look = Engine("inside.entry", "entry", "ctx search")
"""``look(ctx, search)``: see `integrators.kernel.inside.entry`; the steps call its address too."""

follow = Engine("tangent.entry", "entry", "operation ctx memory")
"""``follow(what, ctx, tangents)``: see `integrators.kernel.tangent.entry`; the steps call its address."""

orthonormal = Engine("tangent.rounds", "entry", "frame")
"""``orthonormal(frame)``: see `integrators.kernel.tangent.rounds`."""

record = Engine("adjoint.entry", "record", "event ctx tape")
"""``record(event, ctx, tape)``: see `integrators.kernel.adjoint.entry`; the steps call its address."""

pull = Engine("adjoint.entry", "pull", "ctx pullback")
"""``pull(ctx, pullback)``: see `integrators.kernel.adjoint.entry`."""

lanes = Around("ensemble.steps", "steps", "constants group count")
"""Steps of so many trajectories side by side, with a `Form` as constants; see `ensemble.steps`."""

run = Engine("ensemble.loop", "run", "group partial budget")
"""``run(group, partial, budget)``: see `integrators.kernel.ensemble.loop`."""

run_own = Engine("ensemble.own", "run", "group budget")
"""``run_own(group, budget)``: see `integrators.kernel.ensemble.own`."""
