"""Methods that misbehave in every way a third party's may; registered for these tests only."""

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from integrators.protocol import MethodBase, Samples, Stats, Status
from problems.errors import MissingLibraryError


class ToyStepper:
    def __init__(self, method, y0, t0, steps=1):
        self.method, self.y, self.t = method, np.array(y0), t0
        self.status, self.reason, self.stats = Status.RUNNING, "", Stats(steps=steps, evaluations=2)

    def step(self):
        return self.status

    def advance(self, times, *, sample=None):
        times = np.asarray(times, dtype=float)
        self.t = float(times[-1])
        return self.method.samples(times, np.tile(self.y, (times.size, 1)))

    def checkpoint(self):
        return self.t

    def restore(self, checkpoint):
        self.t = checkpoint


@dataclass
class ToyProgram:
    method: "ToyBase"
    compile_seconds: float = 0.25
    from_cache: bool | None = False
    cores: int = 1

    def start(self, y0, par=None, t0=0.0):
        return ToyStepper(self.method, y0, t0, self.cores)


@dataclass(frozen=True, kw_only=True)
class ToyBase(MethodBase):
    library = "toys"
    citation = "@misc{toy, title = {A toy}}"
    family = "toy"

    @property
    def order(self):
        return 1

    def accepts(self, problem):
        return None

    def compile(self, system):
        return ToyProgram(self)

    def samples(self, times, states):
        return Samples(times, states, Status.FINISHED)


@dataclass(frozen=True, kw_only=True)
class Steady(ToyBase):
    """Stays where it is."""

    h: float = 0.1
    wait: float = 0.0

    def samples(self, times, states):
        time.sleep(self.wait)
        return super().samples(times, states)


@dataclass(frozen=True, kw_only=True)
class Waving(ToyBase):
    """Has numbers with all their digits in its states."""

    h: float = 0.1
    wait: float = 0.0

    def samples(self, times, states):
        time.sleep(self.wait)
        states[1:] += 1e-6 * np.sin(self.h * times[1:, None] + np.arange(states.shape[1]))
        return super().samples(times, states)


@dataclass(frozen=True, kw_only=True)
class Pinned(ToyBase):
    """Counts as steps the cores it may use."""

    def compile(self, system):
        return ToyProgram(self, cores=len(os.sched_getaffinity(0)))


_counted = []


@dataclass(frozen=True, kw_only=True)
class Counting(ToyBase):
    """Counts as steps how often it was compiled in this process; may leave a thread or a process behind."""

    h: float = 0.1
    leaves: str = ""

    def compile(self, system):
        _counted.append(self)
        if self.leaves == "thread":
            threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
        if self.leaves == "child":
            subprocess.Popen(["sleep", "60"])
        return ToyProgram(self, cores=len(_counted))


@dataclass(frozen=True, kw_only=True)
class Cautious(ToyBase):
    """Warns of itself."""

    def caveat(self, problem):
        return "it is a toy."


@dataclass(frozen=True, kw_only=True)
class Straying(ToyBase):
    """Leaves the axis."""

    def samples(self, times, states):
        states[1:, 6] = 1e-3
        return super().samples(times, states)


@dataclass(frozen=True, kw_only=True)
class Stalling(ToyBase):
    """Stalls in the middle."""

    def samples(self, times, states):
        half = times.size // 2
        return Samples(times[:half], states[:half], Status.STALLED, "it crawled.")


@dataclass(frozen=True, kw_only=True)
class Endless(ToyBase):
    """Never returns."""

    def samples(self, times, states):
        while True:
            time.sleep(0.1)


@dataclass(frozen=True, kw_only=True)
class Compiling(ToyBase):
    """Takes its time to compile."""

    wait: float = 1.5

    def compile(self, system):
        time.sleep(self.wait)
        return ToyProgram(self)


@dataclass(frozen=True, kw_only=True)
class Crashing(ToyBase):
    """Dies of a signal: always, or so many times, which it counts in a file."""

    number: int = int(signal.SIGSEGV)
    counted: str = ""
    times: int = 0

    def samples(self, times, states):
        if self.counted:
            with Path(self.counted).open("ab") as file:
                file.write(b".")
                if file.tell() > self.times:
                    return super().samples(times, states)
        os.kill(os.getpid(), self.number)
        time.sleep(5)
        return None


@dataclass(frozen=True, kw_only=True)
class Raising(ToyBase):
    """Raises what no method should."""

    def samples(self, times, states):
        raise RuntimeError("something <b>broke</b>")


@dataclass(frozen=True, kw_only=True)
class Exiting(ToyBase):
    """Leaves without a word."""

    code: int = 0

    def samples(self, times, states):
        os._exit(self.code)


@dataclass(frozen=True, kw_only=True)
class Hungry(ToyBase):
    """Eats memory, 32 MB at a time or all at once."""

    gigabytes: float = 0.0

    def samples(self, times, states):
        eaten = [np.ones(int(self.gigabytes * 1.25e8))]
        while True:
            eaten.append(np.ones(4_000_000))
            time.sleep(0.01)


@dataclass(frozen=True, kw_only=True)
class Garbage(ToyBase):
    """Breaks the protocol, or writes nonsense."""

    what: str = "shape"

    def samples(self, times, states):
        match self.what:
            case "shape":
                return Samples(times, states[:, :3], Status.FINISHED)
            case "times":
                return Samples(times + 1, states, Status.FINISHED)
            case "few":
                return Samples(times[:2], states[:2], Status.FINISHED)
            case "nan":
                states[-1] = np.nan
            case "complex":
                states = states * 1j
            case "noise":
                sys.stdout.buffer.write(os.urandom(1 << 20))
                sys.stdout.flush()
        return super().samples(times, states)


@dataclass(frozen=True, kw_only=True)
class Refusing(ToyBase):
    """Accepts nothing."""

    def accepts(self, problem):
        return "it accepts nothing."


@dataclass(frozen=True, kw_only=True)
class Missing(ToyBase):
    """Needs a library that is not there."""

    def compile(self, system):
        raise MissingLibraryError("this needs the library nowhere; install it with: pip install nowhere.")
