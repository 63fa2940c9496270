"""What the commands share that measure in a process of its own."""

import shlex
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import msgspec
import typer

from hbvm_bench.run import processes


def measure(
    module: str,
    request: msgspec.Struct,
    environment: Mapping[str, str] = MappingProxyType({}),
    kept: str = "",
) -> int:
    """Have a module do what a request asks and return the exit code; end this process on Ctrl-C.

    Parameters
    ----------
    module : str
        Run as ``python -m``, with the path of the request.
    request : msgspec.Struct
        What it is asked to do.
    environment : mapping of str
        See `hbvm_bench.run.processes.wait`.
    kept : str
        What to say of the results on Ctrl-C.
    """
    with tempfile.TemporaryDirectory(prefix="hbvm-bench-") as scratch:
        path = Path(scratch) / "request.json"
        path.write_bytes(msgspec.json.encode(request))
        try:
            return processes.wait([sys.executable, "-m", module, str(path)], environment)
        except KeyboardInterrupt:
            if kept:
                print(f"hbvm-bench: interrupted; {kept}; --redraw shows them.", file=sys.stderr)
            raise typer.Exit(130) from None


def command(words: Sequence[str], out: Path | None) -> str:
    """Return how to run a command again; a path of this machine, which is nobody else's, is left out."""
    place = [] if out is None or out.is_absolute() else ["--out", str(out)]
    return shlex.join(["hbvm-bench", *words, *place])
