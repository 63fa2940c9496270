"""The page on random Hamiltonians, from stored results alone."""

from collections.abc import Callable, Sequence
from functools import partial
from statistics import median
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from hbvm_bench.measure.computation import Task
from hbvm_bench.report.document import Block, Items, Note
from hbvm_bench.report.figures.canvas import WIDTH
from hbvm_bench.report.figures.direct import MOST, End, label
from hbvm_bench.report.figures.drawn import Said, drawn
from hbvm_bench.report.figures.over_time import cut
from hbvm_bench.report.figures.style import MUTED, look
from hbvm_bench.report.page import Results
from hbvm_bench.report.parts import Part, PartResults, tasks_of
from hbvm_bench.summaries.rows import seconds as in_words
from hbvm_bench.summaries.table import NONE, Table

from .systems import COUNT, DRAWS, FAMILIES, SEED, family_of
from .trials import (
    CRASHED,
    LIMIT,
    METHODS,
    NO_ANSWER,
    REFUSED,
    SLOW_DRAWS,
    TOLERANCE,
    Outcome,
    Reference,
    Trial,
    asked,
    reference,
    trial,
)

RUN = range(0, COUNT, DRAWS)  # problems of a run: one of each formula; 200 take forty minutes of two cores
QUICK = (0, 52)  # problems of a quick run, and its methods
QUICK_METHODS = ("HBVM()", "Taylor(tol=1e-10)", "DOP853(rtol=1e-10, atol=1e-06)")
FACTORS = (10.0, 100.0, 1000.0)
UNANSWERED = (NO_ANSWER, CRASHED)
Judge = Callable[[Outcome, Trial], float]


def parts(numbers: Sequence[int], methods: Sequence[str]) -> list[Part]:
    """Return what is computed and shown of these problems and settings."""
    references = [
        Task(f"{number} reference", partial(reference, number), cost=2.0, limit=LIMIT) for number in numbers
    ]
    runs = [
        Task(f"{number} {method}", partial(trial, number, method), limit=LIMIT)
        for number in numbers
        for method in asked(number, methods)
    ]

    return [Part("trials", "Silent failures", [*references, *runs], lambda results: [], lambda results: [])]


def outcome_of(results: PartResults, number: int, methods: Sequence[str]) -> Outcome:
    """Return what is stored of a problem; a process without an answer is a trial, too."""

    def answer(name: str, ended: Callable[[str], Any]) -> Any:
        outcome = results.outcome(name)
        if outcome in ("ok", ""):
            return results[name]
        return ended(NO_ANSWER if outcome == "timeout" else CRASHED)

    trials = [answer(f"{number} {method}", partial(Trial, method)) for method in asked(number, methods)]
    truth = answer(f"{number} reference", lambda why: Reference(why=f"the reference: {why}"))
    return Outcome(number, truth, trials)


def tasks(quick: bool) -> list[Task]:
    """Return the computations of a quick run, or of a whole one."""
    return tasks_of(parts(QUICK, QUICK_METHODS) if quick else parts(RUN, METHODS))


def outcomes(run: Results) -> list[Outcome]:
    """Return what is stored of all problems that were run."""
    methods = QUICK_METHODS if run.runs[-1].index.campaign.quick else METHODS
    (part,) = parts(range(COUNT), methods)
    results = PartResults(part, run)
    there = [number for number in range(COUNT) if results.outcome(f"{number} reference")]
    return [outcome_of(results, number, methods) for number in there]


def problems_run(run: Results) -> int:
    """Return of how many problems there are results."""
    return len(outcomes(run))


def positions(run: Results) -> list[Block]:
    """Return how often positions are wrong behind a success, drawn and as a table."""
    found = outcomes(run)
    return [picture(found), wrong(found, position, "position", POSITION)]


def details(run: Results) -> list[Block]:
    """Return the energy, how the integrations ended, the families, and what is left out."""
    found = outcomes(run)
    return [
        wrong(found, energy, "energy", ENERGY),
        endings(found),
        families(found),
        left_out(found),
        Note(f"{len(found)} problems {HOW}"),
    ]


def counts(run: Results) -> dict[str, tuple[int, int]]:
    """Return for each method how many positions are wrong by more than ten times, and of how many."""
    found = {method: counted(outcomes(run), method, position) for method in METHODS}
    return {name: (sum(f > FACTORS[0] for f in factors), total) for name, (total, factors) in found.items()}


def position(outcome: Outcome, trial: Trial) -> float:
    """Return the error of the position over the condition number and the tolerance; NaN if not judged."""
    expected = TOLERANCE * max(1.0, outcome.reference.condition)
    return outcome.position_error(trial) / expected if outcome.judged else np.nan


def energy(outcome: Outcome, trial: Trial) -> float:
    """Return the change of the energy over its scale and the tolerance; NaN where it is not conserved."""
    del outcome
    return trial.energy / TOLERANCE


def counted(outcomes: Sequence[Outcome], method: str, judge: Judge) -> tuple[int, list[float]]:
    """Return how many problems a method was judged on, and the factors of those that it says it solved.

    A failure that was reported, and a process that had to be ended, counts as judged and is not wrong.
    """
    asked = [
        (outcome, trial)
        for outcome in outcomes
        for trial in outcome.trials
        if trial.method == method and trial.status != REFUSED and outcome.reference.end
    ]
    known = [(outcome, judge(outcome, trial), trial.success) for outcome, trial in asked]
    factors = [factor for _, factor, success in known if success and not np.isnan(factor)]
    failed = sum(not success and _judges(outcome, judge) for outcome, _, success in known)
    return len(factors) + failed, factors


def _judges(outcome: Outcome, judge: Judge) -> bool:
    """Whether any integrator that arrived has a factor here."""
    return any(not np.isnan(judge(outcome, trial)) for trial in outcome.trials if trial.success)


def share(count: int, total: int) -> str:
    """Return a share with its 95 % interval (Wilson): ``"3 of 200: 1.5 % [0.5, 4.3]"``."""
    if not total:
        return NONE
    from scipy.stats import binomtest  # what draws a page may load it

    low, high = binomtest(count, total).proportion_ci(method="wilson")
    return f"{count} of {total}: {count / total:.1%} [{100 * low:.1f}, {100 * high:.1f}]"


def wrong(outcomes: Sequence[Outcome], judge: Judge, quantity: str, note: str) -> Table:
    """Return how often each method reports success beyond each of the factors."""
    rows = []
    for method in METHODS:
        total, factors = counted(outcomes, method, judge)
        rows.append(
            (
                method,
                *(share(sum(outcome > factor for outcome in factors), total) for factor in FACTORS),
                f"{median(factors):.1g}" if factors else NONE,
                f"{max(factors):.1g}" if factors else NONE,
            )
        )
    heads = tuple(f"> {factor:g} times" for factor in FACTORS)
    return Table(
        f"Success reported, {quantity} wrong",
        ("method", *heads, "median", "largest"),
        rows,
        note,
        key=f"random-{quantity}",
    )


@drawn("random-factors", "Silent failures", WIDTH, 3.3)
def picture(figure: Figure, outcomes: Sequence[Outcome]) -> Said:
    """Draw the share of problems by the factor that the error exceeds, of the methods with the largest."""
    found = {method: counted(outcomes, method, position) for method in METHODS}
    ranked = sorted(
        (method for method in METHODS if found[method][1]), key=lambda method: -max(found[method][1])
    )
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.12, 0.16, 0.55, 0.76))
    axes.set(xscale="log", xlim=(1e-3, 1e5), ylim=(0, 1))
    axes.set_xlabel("position error / (tolerance × condition number)")
    axes.set_title("share of problems beyond", fontweight="normal")
    ends, said = [], []
    for method in ranked[:MOST]:
        total, factors = found[method]
        colour, x = look(method.partition("(")[0])[0], np.sort(np.maximum(factors, 1e-8))
        y = np.arange(len(x), 0, -1) / total
        dash = (
            "dashed" if method in ('CVODE(rtol=1e-10, atol=1e-12, method="Adams")', METHODS[8]) else "solid"
        )
        axes.step(x, y, where="post", label=method, color=colour, linestyle=dash)
        ends.append(
            End(cut(short(method), 24), float(y[np.searchsorted(x, 10.0)] if x[-1] > 10.0 else 0.0), colour)
        )
        said.append(f"{method}: {sum(factor > FACTORS[0] for factor in factors)} of {total}")
    for factor in FACTORS:
        axes.axvline(factor, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    label(axes, ends)
    return (
        "Share of the problems in which the method reports success and the error of the position at the end "
        f"is larger than so many times the tolerance times the condition number: the {MOST} methods whose "
        "largest errors are largest; the table has all. Names stand at the height of 10 times.",
        f"Beyond {FACTORS[0]:g} times: " + "; ".join(said) + ".",
    )


def short(method: str) -> str:
    """Return a method without what all are asked for."""
    return method.replace("rtol=1e-10, ", "").replace("atol=1e-12, ", "")


def endings(outcomes: Sequence[Outcome]) -> Table:
    """Return how the integrations ended, and their times."""
    rows = []
    solved = [outcome for outcome in outcomes if outcome.reference.end]
    for method in METHODS:
        ended = [trial for outcome in solved for trial in outcome.trials if trial.method == method]
        ran = [trial for trial in ended if trial.status != REFUSED]
        reported = sum(not trial.success and trial.status not in UNANSWERED for trial in ran)
        hung = sum(
            trial.method == method and trial.status in UNANSWERED
            for outcome in outcomes
            for trial in outcome.trials
        )
        times = [trial.seconds for trial in ran if trial.success]
        rows.append(
            (
                method,
                f"{len(ran)}",
                f"{len(ended) - len(ran)}" if len(ended) > len(ran) else NONE,
                share(reported, len(ran)),
                f"{hung}" if hung else NONE,
                in_words(median(times)) if times else NONE,
                in_words(max(times)) if times else NONE,
                f"{median([trial.steps for trial in ran if trial.success]):.0f}" if times else NONE,
            )
        )
    return Table(
        "Failures reported, and times",
        (
            "method",
            "problems",
            "refused",
            "failure reported",
            "no answer, of all problems",
            "median time",
            "longest",
            "steps",
        ),
        rows,
        "Of the problems with a reference. No answer: the process crashed or was ended after "
        f"{LIMIT:g} s; counted on all problems. "
        "Times: CPU seconds of one run without compiling, through `integrate`, beside a second process of "
        "the same kind: orders of magnitude. Steps: the median.",
        key="random-endings",
    )


def families(outcomes: Sequence[Outcome]) -> Table:
    """Return by family how many positions are wrong."""
    factor = FACTORS[1]
    rows = []
    for method in METHODS:
        cells = []
        for family in FAMILIES:
            total, factors = counted(
                [outcome for outcome in outcomes if family_of(outcome.number) == family], method, position
            )
            cells.append(f"{sum(outcome > factor for outcome in factors)} of {total}" if total else NONE)
        rows.append((method, *cells))
    return Table(
        f"Success reported, position wrong by more than {factor:g} times, by family",
        ("method", *FAMILIES),
        rows,
        "Problems of each family.",
        key="random-families",
    )


def left_out(outcomes: Sequence[Outcome]) -> Items:
    """Return which problems are not judged, and what was reported on those without a reference."""
    said: dict[str, list[int]] = {}
    for outcome in outcomes:
        if not outcome.reference.end:
            asked = [trial for trial in outcome.trials if trial.status != REFUSED]
            failed = [trial.method for trial in asked if not trial.success]
            who = "all" if not failed else f"all but {', '.join(failed)}"
            who = "none" if len(failed) == len(asked) else who
            why = f"no reference: {outcome.reference.why.rstrip('.')}. Success reported by {who}."
        elif not outcome.judged:
            why = f"condition number {outcome.reference.condition:.1e}; positions are not judged."
        else:
            continue
        said.setdefault(f"({family_of(outcome.number)}): {why}", []).append(outcome.number)
    lines = [
        f"{'problem' if len(numbers) == 1 else 'problems'} {', '.join(map(str, numbers))} {why}"
        for why, numbers in said.items()
    ]
    return Items(lines or ["All problems are judged."])


POSITION = (
    f"Error of the positions at the end over their distance from the origin, over {TOLERANCE:g} times the "
    "condition number of that end. In brackets: 95 % interval in per cent (Wilson). Median and largest: of "
    "this quotient. Local errors add up over the steps, so that a factor of 10 alone may be within what a "
    "method promises; a factor of 1000 is not."
)
ENERGY = (
    f"Change of the energy from start to end, where it is conserved, over {TOLERANCE:g} times its scale: the "
    "sum of |∂H/∂y y| over the components, so that a constant added to H changes nothing."
)
HOW = (
    f"of {len(FAMILIES)} families, drawn from the seed {SEED}: "
    "`problem(number)` in `reports/random/systems.py` returns each. Five numbers in a row "
    "have one formula and their own coefficients, initial state and interval; the intervals of shares "
    f"take all as independent. Every method is asked for {TOLERANCE:g}; `HBVM()`, `Taylor()` and `IAS15` "
    "choose their accuracy themselves and are judged by the same. `atol=1e-06` is SciPy's default. Radau, "
    f"which takes seconds, has the first {SLOW_DRAWS} of the {DRAWS} of each formula. References: two "
    "computations in 113-bit and double-double arithmetic that agree to 1e-16. Condition number: how far the "
    "end moves when the state at the worst time is changed by a small part of itself "
    "(`hbvm_bench.reference.condition`). "
    "Where it is above 1e7, positions are not judged."
)
