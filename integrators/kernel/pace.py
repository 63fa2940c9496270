"""How many steps compiled code takes between two looks at Ctrl-C."""

from time import perf_counter

SOON = 0.05  # seconds from one look to the next, about
FEWEST = 16  # steps before the first look, where they may be expensive


class Pace:
    """Steps to take until the next look: as many as take `SOON`, as measured.

    Parameters
    ----------
    most : int
        Steps between two looks, at most.
    dim : int
        Length of the state: steps of a small system are so cheap that one need not begin with few.

    Attributes
    ----------
    steps : int
        How many to take now.
    """

    def __init__(self, most: int, dim: int):
        self._most = most
        self.steps = min(max((1 << 16) // dim**2, FEWEST), most)

    def __enter__(self) -> "Pace":
        self._started = perf_counter()
        return self

    def __exit__(self, *_: object) -> None:
        soon = perf_counter() - self._started < SOON
        self.steps = min(4 * self.steps, self._most) if soon else max(self.steps // 2, 1)
