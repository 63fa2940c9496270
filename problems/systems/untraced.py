"""The former place and name of `problems.systems.opaque.Opaque`, for pickles and for the kernel."""

from problems.systems.opaque import Opaque as Foreign

__all__ = ["Foreign"]
