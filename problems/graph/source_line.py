"""Errors in a user's function, told with the line that caused them and the remedy."""

import linecache
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, NoReturn

from problems.errors import InputError, shown


def _is_users(frame: FrameType) -> bool:
    """Whether a frame runs a definition: a user's or a built-in problem's, and not what traces it."""
    module = str(frame.f_globals.get("__name__", ""))
    if module.startswith("problems.catalogue."):
        return True
    return module.split(".")[0] not in ("problems", "numpy", "math", "builtins")


def _describe(filename: str, line: int) -> str:
    text = linecache.getline(filename, line).strip()
    place = f"{Path(filename).name}:{line}"
    return f"{place}: `{text}`" if text else place


def users_line() -> str:
    """Return the user's line now running, as ``"file.py:12: `code`"`` (empty when there is none)."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        if _is_users(frame):
            return _describe(frame.f_code.co_filename, frame.f_lineno)
        frame = frame.f_back
    return ""


def line_of_traceback(traceback: TracebackType | None) -> str:
    """Return the innermost line of the user's in a traceback (empty when there is none)."""
    line = ""
    while traceback is not None:
        if _is_users(traceback.tb_frame):
            line = _describe(traceback.tb_frame.f_code.co_filename, traceback.tb_lineno)
        traceback = traceback.tb_next
    return line


def line_of_function(function: Callable[..., Any]) -> str:
    """Return the line where a function is defined, or the function itself where it has no Python code."""
    code = getattr(function, "__code__", None)
    return _describe(code.co_filename, code.co_firstlineno) if code is not None else shown(function)


def refuse(reason: str, remedy: str) -> NoReturn:
    """Raise `InputError` for the user's line now running.

    Parameters
    ----------
    reason : str
        What the line does, as the start of a sentence: ``"this branches on a symbol"``.
    remedy : str
        What to write instead.
    """
    joint = " " if reason.endswith("?") else "; "
    raise InputError(f"{users_line()}: {reason}{joint}{remedy}.")
