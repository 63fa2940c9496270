"""The command ``hbvm-bench warm``."""

import os

from integrators.kernel.ahead import compile_ahead


def warm() -> None:
    """Compile the kernel ahead, once for a machine: the first result then takes a second."""
    for name, seconds in compile_ahead(os.cpu_count() or 1).items():
        print(f"{name}: " + ("compiled before" if seconds is None else f"compiled in {seconds:.1f} s"))


__all__ = ["warm"]
