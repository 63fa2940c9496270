"""What the report says in sentences; every number in them is read from the records."""

from collections.abc import Sequence

from hbvm_bench.campaign.file import TimingPlan
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.measure.metrics import GUARD_TOLERANCE
from hbvm_bench.store.records import Record, Value
from hbvm_bench.summaries import front
from hbvm_bench.summaries.outcomes import disturbed
from hbvm_bench.summaries.points import accurate, is_hbvm_or_gauss, number, short_name
from hbvm_bench.summaries.rows import (
    APART,
    GROUPS,
    RANKED_BY,
    format_metric,
    group_of,
    reached,
    reason_of,
    seconds,
    status_of,
)

RIGHT = {"position_end": 1e-8, "energy_max": 1e-13}
"""The errors in the summary's question "who is fastest among those that are right?\""""
BEST = 3  # of them

REFERENCE_SUBSET = (
    "The position errors are the largest of {} trajectories, taken evenly from all, whose ends are known in "
    "128 bits, relative to the largest distance of a body from the origin at these ends."
)
"""Of an ensemble, where the size differs from `POSITION`'s."""

RULES_TEXT = f"""
Every integrator has the same initial conditions, to the last bit, and receives the same vector field, written
down once as a Hamiltonian; REBOUND, which computes gravity itself, receives the same bodies.

The settings were declared in the campaign file before the run. How many each method has, and
where they come from (chosen by the campaign's author, defaults, the authors' advice, a publication, a use
outside the method's intended regime), is in the table below.

Energy is never ranked without position: the table is sorted by the position error at the end, and
the picture of energy against time stands beside that of position against time.

{POSITION}

Where the problem's symmetry is lost by more than {GUARD_TOLERANCE:g} of the size of the trajectory,
the run follows another trajectory: its position error and its time are excluded: they are printed in brackets
and are not ranked. Where it is lost by less, the row says so.

Invariants are evaluated in double-double arithmetic from the double states, on one grid of times
common to all. Each method reaches the output times in the way that does not change its accuracy: at the ends
of its steps, by a partial step, by dense output of full order, or by stopping at them.

heyoka, JAX and numba compile for the processor at hand; REBOUND and SciPy are used as their wheels
come, built for any processor of the kind. SciPy's solvers are Python and call a vector field
compiled by numba: on a small system most of their time is spent in Python, and a ratio of times compares
implementations. The number of evaluations compares the methods.

A case that stalls, runs out of time or memory, crashes or is refused is a row with its reason; the numbers of
the part that was integrated are excluded.
"""
TIMES = (
    "Times are those of whole integrations without output, compiled beforehand, with one thread on one "
    "core, in a pass of their own with no other case running. {visits} {sample} The table gives the median "
    "and the quartiles; all samples are in the store. Compile times are given separately. Each library "
    "integrates "
    "to the end as its own documentation describes; `hbvm-bench run peers` measures what the benchmark adds "
    "to its time."
)
ENDS = "Where the campaign gives the end state, it replaces the 128-bit solution."
WEAKNESSES_TEXT = """
HBVM(k, s) with k > s conserves the energy and is not symplectic. Gauss (k = s) is symplectic and does not
conserve the energy.

Both are implicit: every step solves a nonlinear system, so they need many evaluations of the vector
field.

A small energy error does not imply a small position error: a wrong state may lie on the right energy surface.
"""
ANGULAR_MOMENTUM = "HBVM does not conserve the angular momentum: its error is of the order of the method."


def _paragraphs(text: str) -> tuple[str, ...]:
    return tuple(" ".join(paragraph.split()) for paragraph in text.strip().split("\n\n"))


RULES = _paragraphs(RULES_TEXT)
WEAKNESSES = _paragraphs(WEAKNESSES_TEXT)


def timing(plan: TimingPlan) -> str:
    """Return how a campaign takes times."""
    alike = ", so that a change of the machine's speed affects all cases alike."
    rounds = f"in {plan.rounds} rounds (slow cases in fewer)" if plan.rounds > 1 else "in one round"
    visits = f"One process takes all cases of a problem in turn, {rounds}{alike}"
    if plan.clock != "wall":
        visits += f" The seconds are CPU time of this {plan.clock}: waiting does not count."
    if plan.front:
        visits += f" A setting is timed in the first compilation alone where {front.RULE}, "
        visits += "unless it is its method's fastest at the errors that the problem or a goal asks for."
    sample = f"A sample lasts at least {seconds(plan.shortest)}."
    return TIMES.format(visits=visits, sample=sample)


def summary(records: Sequence[Record]) -> list[str]:
    """Return the summary of a problem's cases, in sentences."""
    groups = {key: [r for r in records if group_of(r) == key] for key in GROUPS}
    cases = "1 case" if len(records) == 1 else f"{len(records)} cases"
    counted = {
        "on": "follow{s} the trajectory to the end",
        "apart": "reach{es} the end with a large position error",
        "uncompared": "reach{es} the end, where there is no reference solution",
        "off": "lost the symmetry or the energy",
        "ended": "did not reach the end",
    }
    compared = groups["on"] or groups["apart"]
    some = []
    for key, words in counted.items():
        if (count := len(groups[key])) or (key == "on" and compared):
            some.append(f"{count} {words.format(s='s' * (count == 1), es='es' * (count == 1))}")
    sentences = [f"{cases}: {', '.join(some)}."]
    if ranked := _ranked([r for r in records if reached(r)], "position_end"):
        sentences.append(_best("Smallest position error at the end", ranked, "position_end"))
        fast = _ranked([r for r in ranked if accurate(r, RIGHT)], "warm_seconds")
        level = " and ".join(f"{key.partition('_')[0]} to {bound:g}" for key, bound in RIGHT.items())
        if fast:
            sentences.append(_best(f"Fastest of the {len(fast)} with {level}", fast, "warm_seconds"))
        elif any(r.timing for r in ranked):
            sentences.append(f"No timed case reaches {level}.")
    elif part := _ranked(groups["uncompared"], "position_max"):
        near = sum((number(record, "position_max") or 0.0) < APART for record in part)
        why = part[0].result.metrics[RANKED_BY].why
        sentences.append(
            f"{why[0].upper()}{why[1:]}. Up to there, {near} of {len(part)} have a position error "
            f"below {APART:g}."
        )
        sentences.append(_best("Smallest position error up to there", part, "position_max"))
    elif alone := groups["uncompared"]:
        why = alone[0].result.metrics.get(RANKED_BY, Value()).why or "no stored reference for this problem"
        sentences.append(
            f"{why[0].upper()}{why[1:]}: positions are not compared, and nothing is ranked. "
            "`reference = true` in the campaign file, or `--reference`, computes one before the run."
        )
    sentences += disturbed(records)
    stalled = [record for record in groups["ended"] if record.result.outcome == "stalled"]
    said = (f"{record.case.method} {status_of(record)}, as the watchdog detected." for record in stalled)
    return [*sentences, *said]


def shortcomings(records: Sequence[Record]) -> list[str]:
    """Return the shortcomings of HBVM and Gauss: general facts first, then those of this run."""
    turning = any(number(record, "angular_momentum_max") is not None for record in records)
    shown = [*WEAKNESSES, *([ANGULAR_MOMENTUM] if turning else [])]
    for record in records:
        position, energy = number(record, "position_end"), number(record, "energy_max")
        ours = is_hbvm_or_gauss(record) and reached(record)
        if not ours or position is None or energy is None or position < 1e-2:
            continue
        observable, angular = number(record, "observable_error"), number(record, "angular_momentum_max")
        shown.append(
            f"Here {record.case.method} has an energy error of {energy:.1e} "
            f"and a position error of {position:.2g} at the end"
            + ("" if observable is None else f", an error of the observable of {observable:.2g}")
            + ("" if angular is None else f", an error of the angular momentum of {angular:.1e}")
            + "."
        )
    return shown


def excluded(records: Sequence[Record]) -> list[str]:
    """Return which cases take no part in any ranking, and why."""
    return [
        f"{record.case.method} on {short_name(record.case.problem)}: {reason_of(record)}".rstrip(". ") + "."
        for record in records
        if not reached(record)
    ]


def _ranked(records: Sequence[Record], key: str) -> list[Record]:
    """Return the cases that have a metric, the least first."""
    pairs = [(value, record) for record in records if (value := number(record, key)) is not None]
    return [record for _, record in sorted(pairs, key=lambda pair: pair[0])]


def _best(title: str, ranked: Sequence[Record], key: str) -> str:
    parts = []
    for record in ranked[:BEST]:
        energy = number(record, "energy_max")
        beside = f", energy {energy:.1e}" if energy is not None and key == "position_end" else ""
        parts.append(f"{record.case.method} ({format_metric(record, key)}{beside})")
    return f"{title}: {'; '.join(parts)}."
