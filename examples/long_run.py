"""A long run: its progress, Ctrl-C, and going on after a break with the same bits."""

import tempfile
from pathlib import Path

import numpy as np

import integrators
import problems

PLANETS = problems.load("outer_solar_system")
METHOD = integrators.Gauss(s=6, h=0.5)
TIMES = np.linspace(0.0, 200_000.0, 2001)


def interrupt(progress: integrators.Progress) -> None:
    """Say where it is, and press Ctrl-C, so to speak, on the way."""
    if progress.fraction > 0.2:
        print(f"t = {progress.t:.0f}, {progress.steps} steps, {100 * progress.fraction:.0f} %")
        raise KeyboardInterrupt


def main() -> None:
    """Break it, and go on."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "planets.checkpoint"
        part = integrators.integrate(
            PLANETS, METHOD, TIMES, progress=interrupt, checkpoint=path, every_seconds=30.0
        )
        print(part)
        rest = integrators.integrate(PLANETS, METHOD, TIMES, resume=path, progress=True)
    whole = integrators.integrate(PLANETS, METHOD, TIMES)
    print("the same bits as without a break:", bool((rest.y == whole.y).all()))


if __name__ == "__main__":
    main()
