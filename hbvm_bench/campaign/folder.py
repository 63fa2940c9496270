"""Python files beside a campaign's file, and what it names in them: ``./blocks.py:table``.

The files of a folder import each other as those of a package do (``from .systems import SYSTEMS``). They are
run where a user names the campaign or its folder, and nowhere else.
"""

import hashlib
import re
import sys
from collections.abc import Collection
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from problems.errors import InputError, unknown

PLACE = re.compile(r"\./(?P<file>[A-Za-z_]\w*)\.py:(?P<name>[A-Za-z]\w*)")


def named(place: str, folder: Path | None) -> Any:
    """Return what ``./blocks.py:table`` names: ``table`` of ``blocks.py`` in a folder, which is run.

    Raises
    ------
    problems.errors.InputError
        If there is no such folder, file or name, or the file raises.
    """
    match = PLACE.fullmatch(place)
    if match is None:
        raise InputError(f"{place!r} must be ./FILE.py:NAME, a name in a Python file beside the campaign's.")
    if folder is None:
        raise InputError(f"{place} lies beside the campaign's file; say where that is with --study FOLDER.")
    file, name = match["file"], match["name"]
    try:
        found = module(folder, file)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"./{file}.py cannot be run, {type(error).__name__}: {error}.") from error
    if not hasattr(found, name):
        known = {key for key, item in vars(found).items() if callable(item) and not key.startswith("_")}
        raise unknown(f"name in ./{file}.py", name, known)
    return getattr(found, name)


def module(folder: Path, name: str) -> ModuleType:
    """Return a module of a folder, which is imported as a package of its own.

    Raises
    ------
    problems.errors.InputError
        If it has no such file.
    """
    if not (folder / f"{name}.py").is_file():
        raise InputError(f"there is no file {name}.py in {str(folder)!r}.")
    package = f"study_{hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:12]}"
    if package not in sys.modules:
        sys.modules[package] = ModuleType(package)
        sys.modules[package].__path__ = [str(folder.resolve())]
    return import_module(f"{package}.{name}")


def digest(folder: Path, without: Collection[str] = ()) -> str:
    """Return the sha256 of all Python files in a folder and below, but for those of some names."""
    whole = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*.py") if path.name not in without):
        whole.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return whole.hexdigest()
