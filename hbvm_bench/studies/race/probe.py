"""What a fresh process pays before its first result, with empty and with filled caches.

``python -m hbvm_bench.studies.race.probe PROBLEM METHOD`` integrates a thousandth of the interval
and prints the seconds as JSON; `probe` starts it with caches of its own.
"""

import hashlib
import sys
import tempfile
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from hbvm_bench.campaign.file import Case, Limits
from hbvm_bench.run.child import LEAVES, Child, empty_caches, send
from hbvm_bench.store.records import Record, Result
from hbvm_bench.studies.race.families import OURS
from problems.errors import InputError

KEY = "compile times of "  # how the keys of these rows begin; the problem follows
TIMES = 3
SLOW = 5.0  # seconds; what takes longer is measured once
LIMITS = Limits(wall_seconds=180.0)
SHARE = 1e-3
OTHER = "pendulum(t_end=1.0)"  # fills the kernel's cache without the problem's vector field

METHODS: dict[str, Sequence[str]] = {
    OURS: ("Gauss(s=8, h={h})",),
    "Taylor": ("Taylor(tol=1e-14)", "Taylor(tol=1e-14, compact_mode=True)"),
    "IAS15": ("IAS15(epsilon=1e-05, mode='global')",),
    "DOP853": ("DOP853(rtol=1e-12, atol=1e-12)",),
}


class Probe(msgspec.Struct, frozen=True, kw_only=True):
    """What a fresh process pays before its first result.

    Attributes
    ----------
    problem : str
        The name of the problem in the race.
    family, method : str
        Of the setting that was compiled.
    caches : {"empty", "kernel", "full"}
        What was on disk before: nothing; the kernel but not this problem; everything.
    compile_seconds : list of float
        The method's own ``compile``.
    process_seconds : list of float
        From the start of Python to the first integrated state, imports included.
    from_cache : bool or None
        What the method says of the compilation.
    reason : str
        Why there are no seconds.
    """

    problem: str
    family: str
    method: str
    caches: str
    compile_seconds: list[float] = []
    process_seconds: list[float] = []
    from_cache: bool | None = None
    reason: str = ""


class Answer(msgspec.Struct, frozen=True):
    """What the process prints."""

    compile_seconds: float
    from_cache: bool | None
    refused: str = ""


def probe(name: str, problem: str, h: float, families: Sequence[str]) -> list[Probe]:
    """Measure the compile times of a problem, called ``name`` in the race; ``h`` is a step for our method.

    Families that compile nothing are left out.
    """
    return [
        entry
        for family in families
        for template in METHODS.get(family, ())
        for entry in _probes(name, problem, family, template.format(h=h))
    ]


def row_of(name: str, machine: dict[str, str | int], version: str) -> Record:
    """Return the row of the results in which the compile times of a problem lie, beside the cases."""
    return Record(
        id=hashlib.sha256(f"{KEY}{name}".encode()).hexdigest(),
        case=Case(problem="", method=f"{KEY}{name}"),
        role="ours",
        library="hbvm-bench",
        order=None,
        result=Result(outcome="ok", status="finished"),
        versions={"hbvm-bench": version},
        machine=machine,
        finished=datetime.now(UTC).isoformat(timespec="seconds"),
    )


def _probes(name: str, problem: str, family: str, method: str) -> list[Probe]:
    replies: dict[str, list[tuple[float, Answer]]] = {"empty": [], "kernel": [], "full": []}
    try:
        for _ in range(TIMES):
            with tempfile.TemporaryDirectory(prefix="hbvm-bench-") as cache:
                replies["empty"].append(_ask(problem, method, Path(cache)))
                replies["full"].append(_ask(problem, method, Path(cache)))
            if family == OURS:
                with tempfile.TemporaryDirectory(prefix="hbvm-bench-") as cache:
                    _ask(OTHER, method, Path(cache))
                    replies["kernel"].append(_ask(problem, method, Path(cache)))
            if replies["empty"][0][0] > SLOW:
                break
    except InputError as error:
        return [Probe(problem=name, family=family, method=method, caches="empty", reason=str(error))]
    return [
        Probe(
            problem=name,
            family=family,
            method=method,
            caches=caches,
            compile_seconds=[answer.compile_seconds for _, answer in answers],
            process_seconds=[seconds for seconds, _ in answers],
            from_cache=answers[0][1].from_cache,
            reason=answers[0][1].refused,
        )
        for caches, answers in replies.items()
        if answers
    ]


def _ask(problem: str, method: str, cache: Path) -> tuple[float, Answer]:
    process = Child(empty_caches(cache), ("-m", "hbvm_bench.studies.race.probe", problem, method))
    ended = process.ask(b"", LIMITS, compiles=False)
    process.close()
    if not ended.reply:
        raise InputError(f"the process that compiles {method} {ended.words}.")
    return ended.seconds, msgspec.json.decode(ended.reply, type=Answer)


def main(problem_text: str, method_text: str) -> None:
    """Reach a first result and say what its compilation took."""
    import numpy as np

    from hbvm_bench.campaign.identity import make_method, make_problem

    problem, method = make_problem(problem_text), make_method(method_text)
    if reason := method.accepts(problem):
        answer = Answer(0.0, None, reason)
    else:
        program = method.compile(problem.system)
        end = problem.t0 + SHARE * (problem.t_end - problem.t0)
        program.start(problem.y0, problem.par, problem.t0).advance(np.array([end]))
        answer = Answer(float(program.compile_seconds), program.from_cache)
    send(sys.stdout.buffer, LEAVES + msgspec.json.encode(answer))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
