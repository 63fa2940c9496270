"""Solutions in files: JSON and arrays in NumPy's npz format."""

import json
import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array, Stats, Status
from integrators.solution.occurrences import Occurrences
from integrators.solution.plain import doubles, unpacked, unpacked_method, unpacked_problem
from problems.errors import InputError, shown
from problems.problem import Problem

FORMAT = 1
AS_THEY_ARE = ("reason", "t_stop", "compile_seconds", "from_cache")


def read_file(path: Any, problem: Any, readers: Mapping[str | None, Any]) -> Any:
    """Return what a file holds, by the reader of its kind: ``reader(words, arrays, problem)``.

    Raises
    ------
    problems.errors.InputError
        For a file that is not there, is damaged, or is none of these.
    """
    if not isinstance(problem, Problem | None):
        raise InputError(f"problem={shown(problem)} of load must be the Problem that was integrated.")
    try:
        with Path(path).open("rb") as handle, np.load(handle, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        words = json.loads(arrays["words"].tobytes())
        if words["format"] != FORMAT:
            raise InputError(f"{path} is of format {words['format']}, which this version does not read.")
        problem_ = unpacked_problem(words["problem"], arrays) or problem
        if problem_ is None:
            raise InputError(
                f"the field of the solution in {path} is code, which the file does not hold; "
                "load it with problem=, the one that was integrated."
            )
        return readers[words.get("kind")](words, arrays, problem_)
    except (InputError, FileNotFoundError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"there is no file {shown(str(path))}; give one that Solution.save wrote.") from None
    except Exception as error:  # whatever reading a file of any content raises
        why = f"{type(error).__name__}: {shown(str(error))}"
        raise InputError(
            f"{shown(str(path))} is not a solution, or is damaged ({why}); "
            "give a file that Solution.save wrote."
        ) from None


def fields(words: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], problem: Problem) -> dict[str, Any]:
    """Return the attributes of the `Solution` that words and arrays of a file tell of."""
    dim, n = problem.system.dim, np.size(arrays["t"])
    return {
        "t": doubles(arrays["t"], (n,), "t"),
        "y": doubles(arrays["y"], (n, dim), "y"),
        "status": Status(words["status"]),
        "stats": _stats(unpacked(words["stats"], arrays)),
        "problem": problem,
        "method": unpacked_method(words["method"], arrays),
        "events": {name: occurrences(name, arrays, problem) for name in words["events"]},
        "variations": _variations(arrays, n, dim),
        "directions": _directions(arrays, dim, problem.par.size),
        **_digits(arrays, n, dim),
        "error": None if words["error"] is None else RuntimeError(": ".join(words["error"])),
        "reason": of_type(str, words["reason"]),
        "t_stop": of_type(float, words["t_stop"]),
        **compilation(words),
    }


def compilation(words: Mapping[str, Any]) -> dict[str, Any]:
    """Return the seconds of compilation, and whether the code came from a cache."""
    cached = words["from_cache"]
    return {
        "compile_seconds": of_type(float, words["compile_seconds"]),
        "from_cache": None if cached is None else of_type(bool, cached),
    }


def of_type(kind: type[Any], value: Any) -> Any:
    """Return a stored value of a type; whole numbers are numbers too."""
    if type(value) is not kind and not (kind is float and type(value) is int):
        raise TypeError(f"{shown(value)} is no {kind.__name__}")
    return kind(value)


def _stats(stored: Any) -> Stats:
    stats = Stats(**stored)
    counts = (stats.rejections, stats.evaluations, stats.iterations)
    for count in (of_type(int, stats.steps), *(n for n in counts if n is not None)):
        of_type(int, count)
    if stats.solver is not None:
        of_type(str, stats.solver)
    check_extra(stats.extra)
    return stats


def check_extra(extra: Any) -> None:
    """Refuse stored ``extra`` of a trajectory whose parts that warnings are made of have other types."""
    of_type(dict, extra)
    for t, h in extra.get("kinks", ()):  # which `Solution.warnings` reads, as it does the next
        of_type(float, t)
        of_type(float, h)
    for t, change, size in of_type(dict, extra.get("lost", {})).values():
        for number in (t, change, size):
            of_type(float, number)
    of_type(str, extra.get("checkpoint", ""))
    of_type(int, extra.get("implicit", {"steps": 0})["steps"])


def occurrences(name: str, arrays: Mapping[str, NDArray[Any]], problem: Problem) -> Occurrences:
    """Return where an event happened, from the arrays of a file."""
    dim, n_par = problem.system.dim, problem.system.n_par
    t, y, direction = (arrays[f"event_{key}:{of_type(str, name)}"] for key in ("t", "y", "direction"))
    if direction.dtype.kind != "i" or direction.shape != t.shape:
        raise TypeError(f"the directions of {shown(name)} are not as many as its times")
    n = np.size(t)
    after, par = arrays.get(f"event_after:{name}"), arrays.get(f"event_par:{name}")
    return Occurrences(
        doubles(t, (n,), "t"), doubles(y, (n, dim), "y"), direction.astype(np.int64),
        None if after is None else doubles(after, (n, dim), "after"),
        None if par is None else doubles(par, (n, n_par), "par"),
    )  # fmt: skip


def _digits(arrays: Mapping[str, NDArray[Any]], n: int, dim: int) -> dict[str, Array]:
    """Return the low parts of states and the start in pairs, which a file has both or none of."""
    if "low" not in arrays and "start" not in arrays:
        return {}
    if "variations" in arrays or "directions_state" in arrays:
        raise TypeError("low parts and variations do not go together")
    return {
        "low": doubles(arrays["low"], (n, dim), "low"),
        "start": doubles(arrays["start"], (dim, 2), "start"),
    }


def _variations(arrays: Mapping[str, NDArray[Any]], n: int, dim: int) -> Array | None:
    vectors = arrays.get("variations")
    return None if vectors is None else doubles(vectors, (n, dim, vectors.shape[-1]), "variations")


def _directions(arrays: Mapping[str, NDArray[Any]], dim: int, n_par: int) -> tuple[Array, Array] | None:
    state, parameters = arrays.get("directions_state"), arrays.get("directions_parameters")
    if state is None or parameters is None:
        return None
    n = state.shape[-1]
    return doubles(state, (dim, n), "directions"), doubles(parameters, (n_par, n), "directions")


def write(path: Path, words: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write words and arrays to a file that `read_file` reads; an existing one is replaced whole."""
    text = np.frombuffer(json.dumps({"format": FORMAT, **words}).encode(), dtype=np.uint8)
    write_whole(path, lambda file: np.savez(file, words=text, **arrays))  # pyright: ignore[reportArgumentType]


def write_whole(path: Path, write: Any) -> None:
    """Write a file under another name and give it its own when it is complete.

    Raises
    ------
    problems.errors.InputError
        If that cannot be done.
    """
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".tmp")
        with os.fdopen(handle, "wb") as file:
            write(file)
        Path(temporary).replace(path)
    except OSError as error:
        where = shown(str(path))
        raise InputError(f"{where} cannot be written: {error.strerror}; give another path.") from None
    finally:
        if temporary is not None:
            with suppress(OSError):
                Path(temporary).unlink()
