"""The protocol that every integrator satisfies.

Guide for implementers
----------------------
A **method** is a description; it holds only options.

For a method with a fixed step size derive from `integrators.stepping.FixedStep`; only the class attributes,
``accepts`` and the function that takes the steps have to be written.

1. Derive a frozen, keyword-only dataclass from `MethodBase`. Annotate each option with its constraint
   (`problems.checks`, `integrators.options`), which is then checked. Check conditions on several options in
   ``__post_init__``, after that of the base, and raise `problems.errors.InputError`.
2. Set the class attributes ``library`` (the package that does the work), ``citation`` (how its authors ask
   to be cited) and ``order`` (``None`` where the order varies with the tolerance).
3. ``accepts(problem)`` returns ``None``, or a sentence on why the method cannot integrate it. Where the
   system alone decides, define ``refuses(system)`` instead. Omit both if the method accepts every system.
4. ``compile(system)`` does all compilation, imports the library (raising
   `problems.errors.MissingLibraryError`) and returns a `Program`, which knows the seconds that this took.
   Parameters are run-time values.
5. ``program.start(y0, par, t0)`` returns a `Stepper` at ``t0``.
6. A stepper's ``advance`` does most of the work in compiled code and returns the samples it reached;
   ``step`` takes one step, for inspection. The class attribute ``to_end`` names the sampling with which the
   library itself integrates to an end time, if it differs from the default: that one is timed.
7. A numerical failure is a `Status`, never an exception, never a silent NaN, and never an endless loop; the
   samples computed before it are returned.
8. Register the class under the entry point group ``hbvm_bench.integrators``; `integrators.testing` then
   checks it against this guide.

The following is optional. Each capability is a class, which the rest of the package tests for
by `offers`; without it the method still integrates. The conformance kit checks those that are offered.

9. `Samplings`: the attribute ``samplings`` of a stepper lists the samplings that its ``advance`` supports,
   the default first. Without it all of `SAMPLINGS` are expected.
10. `Checkpoints`: ``checkpoint`` returns all data that a bitwise identical continuation needs, with the
    identity of the integration (`integrators.running.checkpoints.Identity`); ``restore`` accepts only such a
    checkpoint. Checkpoint files need it (``integrate(checkpoint=...)``).
11. `Destination`: the attribute ``destination`` of a stepper is the end of the whole integration, which
    `integrate` reaches in pieces. The vector field is not evaluated beyond it: the last step is shortened.
    Whether steps have collapsed is judged by the way to it, see `integrators.running.watchdog`.
12. `KeptError`: after ``USER_ERROR``, ``error`` is the exception raised by a user function.
13. `Events`: ``with_events`` of a program starts steppers that search their steps for events. Such a
    stepper has the ``search``, and ``look_to``, which searches the next step up to the last time.
    `Actions`: with ``acts`` these events may change the state and the parameters. `BatchesEvents`: what
    ``with_events`` returns can ``find_in_batch`` the events of many trajectories, if it
    ``goes_in_batches``.
14. `Interruptible`: another thread sets ``stop`` of a stepper to interrupt ``advance``. Many trajectories
    with events are integrated in several threads. After ``time_limit`` seconds ``advance`` returns the
    samples that it has computed, so that `integrate` can request all of them at once and Ctrl-C loses few.
15. `Batches`: ``batch`` of a program integrates many initial conditions faster than one after another, for
    `integrate_many`. `PreparedBatches`: ``prepare_batch`` does everything except the integration, which the
    benchmark can then time separately. `Threads`: with ``threaded`` it takes ``threads=``. `PieceSize`:
    ``piece`` is the recommended number of trajectories of the first call. `SharedSteps`: ``share`` of a
    stepper lets several threads share each step.
16. `Variations`: ``follow`` of a stepper propagates tangent vectors; ``variations`` are the vectors at the
    samples of the last ``advance``. `BatchesAlong`: ``batch_along`` of a program integrates many initial
    conditions with tangent vectors, if it ``goes_along`` with so many.
17. `Gradients`: a stepper can ``record`` its steps, and ``adjoint`` integrates the adjoint equations over
    them backwards. `integrators.gradient` needs this and `Checkpoints`.
18. `DoubleDouble`: ``start_pairs`` of a program starts from states with twice the digits of a double;
    ``low`` of such a stepper has the low parts of the samples.
19. `AsHBVM`: ``as_hbvm`` of a method returns the HBVM(k, s) that it is identical to; `integrators.order_of`
    and the plugins use its coefficients.
"""

from integrators.protocol.capabilities import (  # noqa: F401 -- some are for this package only
    CAPABILITIES,
    Actions,
    AsHBVM,
    Batches,
    BatchesAlong,
    BatchesEvents,
    Checkpoints,
    Destination,
    DoubleDouble,
    Events,
    Gradients,
    Interruptible,
    KeptError,
    PieceSize,
    PreparedBatches,
    Samplings,
    SharedSteps,
    Threads,
    Variations,
    members,
    offers,
)
from integrators.protocol.protocol import (  # noqa: F401 -- some are for this package only
    Compiled,
    MethodBase,
    Program,
    Stepper,
    check_problem,
    check_system,
    cite,
)
from integrators.protocol.values import (  # noqa: F401 -- some are for this package only
    SAMPLINGS,
    Array,
    Samples,
    SamplingName,
    Stats,
    Status,
    Trajectories,
    UserError,
    telling,
    undefined_in,
)

__all__ = [
    "CAPABILITIES",
    "SAMPLINGS",
    "Actions",
    "AsHBVM",
    "Batches",
    "Checkpoints",
    "Destination",
    "DoubleDouble",
    "Events",
    "Gradients",
    "Interruptible",
    "KeptError",
    "MethodBase",
    "PieceSize",
    "PreparedBatches",
    "Program",
    "Samples",
    "Samplings",
    "SharedSteps",
    "Stats",
    "Status",
    "Stepper",
    "Threads",
    "Trajectories",
    "UserError",
    "offers",
]
