"""What the report says in sentences; every number in them is read from the records."""

from collections.abc import Sequence
from statistics import median

from hbvm_bench.measure.measured import POSITION
from hbvm_bench.measure.metrics import GUARD_TOLERANCE, METRICS
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.points import family_of
from hbvm_bench.summaries.rows import group_of, seconds, status_of

# The levels of the summary's question "who is fastest among those that are right?"
RIGHT_POSITION = 1e-8
RIGHT_ENERGY = 1e-13
UNDISTURBED = 0.9  # of a core, in the timing pass

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

Times are those of whole integrations without output, compiled before, with one thread on one core,
in a pass of their own with no other case running: every round visits every case once in a fresh
process, so that a machine that changes its speed touches all alike. A sample lasts at least 20 ms.
The table gives the median and the quartiles; all samples are in the store. Compilation is stated
apart. Each library goes to the end in the way of its own documentation; what the bench adds to its
time is in a table below.

heyoka, JAX and numba compile for the processor at hand; REBOUND and SciPy are used as their wheels
come, built for any processor of the kind. SciPy's solvers are Python and call a vector field
compiled by numba.

A case that stalls, runs out of time or memory, crashes or is refused is a row with its reason; the
numbers of the part that it did run are void.
"""
WEAKNESSES_TEXT = """
HBVM(k, s) with k > s is not symplectic: it keeps the energy, not the volume in phase space.
Gauss (k = s) is symplectic and does not keep the energy.

Both are implicit: every step solves a nonlinear system, so they need many evaluations of the vector
field.

HBVM keeps the angular momentum only as far as its order does.

Conserving the energy is not accuracy: it does not say where on the energy surface the state is.
"""


def _paragraphs(text: str) -> tuple[str, ...]:
    return tuple(" ".join(paragraph.split()) for paragraph in text.strip().split("\n\n"))


RULES = _paragraphs(RULES_TEXT)
WEAKNESSES = _paragraphs(WEAKNESSES_TEXT)


def summary(records: Sequence[Record]) -> list[str]:
    """Return what came out of a problem's cases, in sentences, whoever wins."""
    groups = {key: [r for r in records if group_of(r) == key] for key in ("on", "off", "ended")}
    sentences = [
        f"{_count(len(records), 'case')}: {len(groups['on'])} follow the trajectory to the end, "
        f"{len(groups['off'])} lost its symmetry, {len(groups['ended'])} did not reach the end."
    ]
    ranked = sorted(_counted(groups["on"], "position_end"), key=lambda r: _number(r, "position_end"))
    if ranked:
        sentences.append(_best("Smallest position error at the end", ranked[:3], "position_end"))
        right = [
            r for r in _counted(ranked, "energy_max", "warm_seconds")
            if _number(r, "position_end") <= RIGHT_POSITION and _number(r, "energy_max") <= RIGHT_ENERGY
        ]  # fmt: skip
        fast = sorted(right, key=lambda r: _number(r, "warm_seconds"))
        level = f"position to {RIGHT_POSITION:g} and energy to {RIGHT_ENERGY:g}"
        if fast:
            sentences.append(_best(f"Fastest of the {len(fast)} that keep {level}", fast[:3], "warm_seconds"))
        elif any(r.timing for r in ranked):
            sentences.append(f"No case that was timed keeps {level}.")
    elif groups["on"]:
        sentences.append(
            "This problem has no stored reference: positions are not measured, and nothing is ranked. "
            "`reference = true` in the campaign file, or `--reference`, computes one before the run."
        )
    shares = [record.timing.share for record in records if record.timing and record.timing.rounds]
    if shares and median(shares) < UNDISTURBED:
        sentences.append(
            f"The times are disturbed: the machine had other work and left half of the cases less than "
            f"{median(shares):.0%} of a core. Compare them with care."
        )
    for record in groups["ended"]:
        if record.result.outcome == "stalled":
            sentences.append(f"{record.case.method} {status_of(record)}, seen by the watchdog.")
    return sentences


def shortcomings(records: Sequence[Record]) -> list[str]:
    """Return what our own methods do wrong, general facts first, then what this run shows."""
    shown = list(WEAKNESSES)
    for record in records:
        if record.role != "ours" or group_of(record) != "on":
            continue
        position, energy = _value(record, "position_end"), _value(record, "energy_max")
        if position is None or energy is None or position < 1e-2:
            continue
        parts = [
            f"Here {record.case.method} has the energy right to {energy:.1e} "
            f"and a position error of {position:.2g} at the end"
        ]
        z, angular = _value(record, "z_error"), _value(record, "angular_momentum_max")
        if z is not None:
            parts.append(f"z wrong by {z:.2g}")
        if angular is not None:
            parts.append(f"the angular momentum off by {angular:.1e}")
        shown.append(", ".join(parts) + "; the paths below show what that does to the orbits.")
    return shown


def settings_count(records: Sequence[Record]) -> list[tuple[str, str, dict[str, int]]]:
    """Return method, library and how many settings it has of each kind."""
    counted: dict[tuple[str, str], dict[str, int]] = {}
    for record in records:
        kinds = counted.setdefault((family_of(record), record.library), {})
        kinds[record.case.settings] = kinds.get(record.case.settings, 0) + 1
    return [(name, library, kinds) for (name, library), kinds in counted.items()]


def excluded(records: Sequence[Record]) -> list[str]:
    """Return which cases take no part in any ranking, and why."""
    said = []
    for record in records:
        group = group_of(record)
        if group == "on":
            continue
        why = record.result.violation if group == "off" else status_of(record)
        reason = f": {record.result.reason}" if group == "ended" and record.result.reason else ""
        said.append(f"{record.case.method} on {record.case.problem}: {why}{reason}".rstrip(". ") + ".")
    return said


def _best(title: str, records: Sequence[Record], key: str) -> str:
    unit = METRICS[key].unit
    parts = []
    for record in records:
        number = _number(record, key)
        text = seconds(number) if unit == "s" else f"{number:.1e}"
        energy = _value(record, "energy_max")
        beside = f", energy {energy:.1e}" if energy is not None and key == "position_end" else ""
        parts.append(f"{record.case.method} ({text}{beside})")
    return f"{title}: {'; '.join(parts)}."


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _counted(records: Sequence[Record], *keys: str) -> list[Record]:
    def has(record: Record, key: str) -> bool:
        value = record.result.metrics.get(key)
        return value is not None and value.counts

    return [record for record in records if all(has(record, key) for key in keys)]


def _value(record: Record, key: str) -> float | None:
    value = record.result.metrics.get(key)
    return None if value is None else value.value


def _number(record: Record, key: str) -> float:
    value = _value(record, key)
    assert value is not None
    return value
