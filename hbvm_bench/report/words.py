"""What the report says in sentences; every number in them is read from the records."""

from collections.abc import Sequence

from hbvm_bench.campaign.file import TimingPlan
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.measure.metrics import GUARD_TOLERANCE
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.outcomes import disturbed
from hbvm_bench.summaries.points import accurate, number
from hbvm_bench.summaries.rows import GROUPS, format_metric, group_of, reached, reason_of, seconds, status_of

RIGHT = {"position_end": 1e-8, "energy_max": 1e-13}
"""The errors in the summary's question "who is fastest among those that are right?\""""
BEST = 3  # of them
SHORTEST_RUN = 1e-6  # seconds; no whole integration takes less

WITNESSES = (
    "The position errors are the largest of {} trajectories, taken evenly from all, whose ends are known in "
    "128 bits, relative to the largest distance of a body from the origin at these ends."
)
"""Of an ensemble, where the size differs from `POSITION`'s."""

RULES_TEXT = f"""
Every integrator starts from the same doubles and receives the same vector field, written down
once as a Hamiltonian; REBOUND, which computes gravity itself, receives the same bodies.

The settings were declared in the campaign file before the run. How many each method has, and
whether they are chosen by whoever wrote the file, the method's defaults, its authors' advice, those
of a publication or a use outside its domain, is in the table below.

Energy is never ranked without position: the table is sorted by the position error at the end, and
the picture of energy against time stands beside that of position against time.

{POSITION}

Where the problem's symmetry is lost by more than {GUARD_TOLERANCE:g} of the size of the trajectory,
the run follows another trajectory: its position error and its time are void, are printed in
brackets, and take part in no ranking. Where it is lost by less, the row says so.

Invariants are evaluated in double-double arithmetic from the double states, on one grid of times
common to all. Each method reaches the grid in the way that costs its quality nothing: by its own
steps, by a partial step aside, by its own step's polynomial at full order, or by landing on it.

heyoka, JAX and numba compile for the processor at hand; REBOUND and SciPy are used as their wheels
come, built for any processor of the kind. SciPy's solvers are Python and call a vector field
compiled by numba: on a small system most of their time is Python's, and a ratio of times to them is
one of implementations. The evaluations compare the methods.

A case that stalls, runs out of time or memory, crashes or is refused is a row with its reason; the
numbers of the part that it did run are void.
"""
TIMES = (
    "Times are those of whole integrations without output, compiled before, with one thread on one core, in "
    "a pass of their own with no other case running. {visits} {sample} The table gives the median and the "
    "quartiles; all samples are in the store. Compilation is stated apart. Each library goes to the end in "
    "the way of its own documentation; what the bench adds to its time is measured by `hbvm-bench run peers`."
)
ENDS = "Where the campaign gives the end state itself, that stands in the place of the 128-bit solution."
WEAKNESSES_TEXT = """
HBVM(k, s) with k > s is not symplectic: it keeps the energy, not the volume in phase space.
Gauss (k = s) is symplectic and does not keep the energy.

Both are implicit: every step solves a nonlinear system, so they need many evaluations of the vector
field.

Conserving the energy is not accuracy: it does not say where on the energy surface the state is.
"""
ANGULAR_MOMENTUM = "HBVM keeps the angular momentum only as far as its order does."


def _paragraphs(text: str) -> tuple[str, ...]:
    return tuple(" ".join(paragraph.split()) for paragraph in text.strip().split("\n\n"))


RULES = _paragraphs(RULES_TEXT)
WEAKNESSES = _paragraphs(WEAKNESSES_TEXT)


def timing(plan: TimingPlan) -> str:
    """Return how a campaign takes times."""
    alike = ", so that a machine that changes its speed touches all alike."
    if plan.interleaved:
        rounds = f"in {plan.rounds} rounds (slow cases in fewer)"
        visits = f"One process takes all cases of a problem in turn, {rounds}{alike}"
    elif plan.rounds > 1:
        visits = f"Each of {plan.rounds} rounds visits every case once, in a fresh process{alike}"
    else:
        visits = "Every case is visited once, in a fresh process."
    if plan.interleaved and plan.clock != "wall":
        visits += (
            f" The seconds are the processor's for this {plan.clock}: waiting for others does not count."
        )
    sample = f"A sample lasts at least {seconds(plan.shortest)}."
    if plan.shortest < SHORTEST_RUN:
        sample = "A sample is one integration."
    return TIMES.format(visits=visits, sample=sample)


def summary(records: Sequence[Record]) -> list[str]:
    """Return what came out of a problem's cases, in sentences, whoever wins."""
    groups = {key: [r for r in records if group_of(r) == key] for key in GROUPS}
    cases = "1 case" if len(records) == 1 else f"{len(records)} cases"
    counted = {
        "on": "follow the trajectory to the end",
        "apart": "reach the end in another place",
        "uncompared": "reach the end and are compared with no reference",
        "off": "lost its symmetry or its energy",
        "ended": "did not reach the end",
    }
    some = [f"{len(groups[key])} {words}" for key, words in counted.items() if groups[key] or key == "on"]
    sentences = [f"{cases}: {', '.join(some)}."]
    if ranked := _ranked([r for r in records if reached(r)], "position_end"):
        sentences.append(_best("Smallest position error at the end", ranked, "position_end"))
        fast = _ranked([r for r in ranked if accurate(r, RIGHT)], "warm_seconds")
        level = " and ".join(f"{key.partition('_')[0]} to {bound:g}" for key, bound in RIGHT.items())
        if fast:
            sentences.append(_best(f"Fastest of the {len(fast)} that keep {level}", fast, "warm_seconds"))
        elif any(r.timing for r in ranked):
            sentences.append(f"No case that was timed keeps {level}.")
    elif groups["uncompared"]:
        sentences.append(
            "This problem has no stored reference: positions are not measured, and nothing is ranked. "
            "`reference = true` in the campaign file, or `--reference`, computes one before the run."
        )
    sentences += disturbed(records)
    stalled = [record for record in groups["ended"] if record.result.outcome == "stalled"]
    said = (f"{record.case.method} {status_of(record)}, seen by the watchdog." for record in stalled)
    return [*sentences, *said]


def shortcomings(records: Sequence[Record]) -> list[str]:
    """Return what our own methods do wrong, general facts first, then what this run shows."""
    turning = any(number(record, "angular_momentum_max") is not None for record in records)
    shown = [*WEAKNESSES, *([ANGULAR_MOMENTUM] if turning else [])]
    for record in records:
        position, energy = number(record, "position_end"), number(record, "energy_max")
        ours = record.role == "ours" and reached(record)
        if not ours or position is None or energy is None or position < 1e-2:
            continue
        z, angular = number(record, "z_error"), number(record, "angular_momentum_max")
        shown.append(
            f"Here {record.case.method} has the energy right to {energy:.1e} "
            f"and a position error of {position:.2g} at the end"
            + ("" if z is None else f", z wrong by {z:.2g}")
            + ("" if angular is None else f", the angular momentum off by {angular:.1e}")
            + "; the paths below show what that does to the orbits."
        )
    return shown


def excluded(records: Sequence[Record]) -> list[str]:
    """Return which cases take no part in any ranking, and why."""
    return [
        f"{record.case.method} on {record.case.problem}: {reason_of(record)}".rstrip(". ") + "."
        for record in records
        if not reached(record)
    ]


def _ranked(records: Sequence[Record], key: str) -> list[Record]:
    """Return the cases that have a metric, the least first."""
    found = [(value, record) for record in records if (value := number(record, key)) is not None]
    return [record for _, record in sorted(found, key=lambda pair: pair[0])]


def _best(title: str, ranked: Sequence[Record], key: str) -> str:
    parts = []
    for record in ranked[:BEST]:
        energy = number(record, "energy_max")
        beside = f", energy {energy:.1e}" if energy is not None and key == "position_end" else ""
        parts.append(f"{record.case.method} ({format_metric(record, key)}{beside})")
    return f"{title}: {'; '.join(parts)}."
