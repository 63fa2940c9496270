"""What is missing on this machine, and whether timings here can be trusted."""

import os
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from statistics import median, quantiles
from typing import Literal

import psutil

import integrators.registry
from hbvm_bench.campaign.identity import version_of
from hbvm_bench.measure import machine, timing
from hbvm_bench.measure.timing import calibrate
from integrators.peers import APART, without_wheels
from problems.errors import InputError

State = Literal["ok", "note", "bad"]

SYSTEM = Path("/sys/devices/system/cpu")
STAT = Path("/proc/stat")
CALIBRATIONS = 60  # of about 10 ms
LARGEST_SCATTER = 0.05  # ninth decile over the first one, less 1
LEAST_SHARE = 0.97  # of a core while calibrating
LARGEST_STEAL = 0.01  # of the wall time of all cores
LOOKS, PAUSE = 9, 0.03  # at the processes that run: something short always does

WITHOUT = {
    "peers": "their methods are refused, and only HBVM and Gauss run",
    "dask": "--executor dask:// does not work",
    "export": "export writes CSV only",
}
"""What happens without the libraries of an optional extra."""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    subject: str  # in a word or two
    state: State  # ``note`` is good to know; ``bad`` makes the results incomplete or their times doubtful
    observed: str  # what it is
    advice: str = ""  # what to do about it; empty where there is nothing to do


def examine(*, calibration: bool = True) -> dict[str, list[Finding]]:
    """Return what is ``"installed"`` and what ``"timings"`` depend on; the calibration takes a second."""
    timings = [cores(), load(), governor(), boost(), vectors(), virtual()]
    return {
        "installed": [python(), *libraries(), *methods()],
        "timings": [*timings, *(steadiness() if calibration else [])],
    }


def healthy(findings: dict[str, list[Finding]]) -> bool:
    """Whether nothing is bad."""
    return not any(finding.state == "bad" for group in findings.values() for finding in group)


def python() -> Finding:
    """Return the versions of Python and of this package."""
    here = machine.describe()
    return Finding("hbvm-bench", "ok", f"{version('hbvm-bench')}, {here['python']}, {here['system']}")


def libraries() -> list[Finding]:
    """Return for every optional library its version, or what does not work without it."""
    findings: list[Finding] = []
    for extra, without in WITHOUT.items():
        state: State = "bad" if extra == "peers" else "note"
        for name in of_extra(extra):
            if name in without_wheels():
                findings.append(_library(name, "note", "not installed: it has no wheels for this system"))
            else:
                advice = f"pip install 'hbvm-bench[{extra}]'"
                findings.append(_library(name, state, f"not installed: {without}", advice))
    refused = "not installed: its methods are refused"
    return findings + [_library(name, "note", refused, f"pip install {name}") for name in APART]


def _library(name: str, state: State, missing: str, advice: str = "") -> Finding:
    """Return the version of a library, or what is said where it is missing."""
    try:
        return Finding(name, "ok", version(name))
    except PackageNotFoundError:
        return Finding(name, state, missing, advice)


def of_extra(extra: str) -> list[str]:
    """Return the libraries that an optional extra of this package installs."""
    marker = re.compile(rf"extra == [\"']{extra}[\"']")
    needed = (text for text in requires("hbvm-bench") or () if marker.search(text))
    return [re.split(r"[^\w.-]", text)[0] for text in needed]


def methods() -> list[Finding]:
    """Return the registered methods of libraries that are no extra of ours, and those that fail to load."""
    findings: list[Finding] = []
    known = integrators.registry.libraries()
    for name in integrators.registry.names():
        try:
            library = integrators.registry.get(name).library
        except InputError as error:
            findings.append(Finding(name, "bad", str(error)))
        except Exception as error:  # a third party's module may raise anything when it is imported
            words = f"cannot be imported: {type(error).__name__}: {error}"
            findings.append(Finding(name, "bad", words, "ask its authors, or uninstall it"))
        else:
            if library.lower() not in known:
                findings.append(Finding(name, "ok", f"{library} {version_of(library)}"))
    return findings


def cores() -> Finding:
    """Return how many cores this process may use: one for the case that is timed, one for the rest."""
    mine, quota = len(machine.cores()), _quota()
    words = f"{mine} of {os.cpu_count() or mine}, {machine.describe()['processor']}"
    if quota is not None and quota < mine:
        words += f", limited to the time of {quota:g}"
    alone = min(mine, quota or mine) < 2
    return _judged("cores", words, alone, "give it two: one is for the case that is timed, alone")


def load() -> Finding:
    """Return how many processes want to run now, besides this one, and on average over a minute."""
    last = f"{psutil.getloadavg()[0]:.2f} in all over the last minute"
    looks: list[int] = []
    for _ in range(LOOKS):
        time.sleep(PAUSE)
        if (running := _running()) is None:
            return Finding("load", "note", f"not visible now, {last}")
        looks.append(max(running - 1, 0))
    others = int(median(looks))
    words = f"{others} other processes want to run, {last}"
    return _judged("load", words, others > 0, "wait for the end of what else runs")


def governor() -> Finding:
    """Return how the system chooses the frequency of the cores."""
    paths = sorted(SYSTEM.glob("cpu[0-9]*/cpufreq/scaling_governor"))
    names = sorted({_read(path) for path in paths} - {""})
    if not names:
        return Finding("governor", "note", "not visible, as in most virtual machines")
    if names == ["performance"]:
        return Finding("governor", "ok", "performance")
    # drivers that choose by themselves are fast under load; the calibration tells
    advice = "for timings: cpupower frequency-set --governor performance"
    return Finding("governor", "note", ", ".join(names), advice)


def boost() -> Finding:
    """Return whether cores run faster while others rest, so that times depend on the neighbors."""
    no_turbo, plain = _read(SYSTEM / "intel_pstate/no_turbo"), _read(SYSTEM / "cpufreq/boost")
    if not (no_turbo or plain):
        return Finding("boost", "note", "not visible")
    if no_turbo == "1" or plain == "0":
        return Finding("boost", "ok", "off")
    return Finding("boost", "note", "on: the frequency depends on heat and on what else runs")


def vectors() -> Finding:
    """Return the widest vector instructions: compiled methods use them, wheels mostly do not."""
    name = str(machine.describe()["vector_instructions"])
    if name == "AVX-512":
        return Finding("vectors", "ok", name)
    words = f"{name}, no AVX-512: HBVM takes more instructions a stage here"
    return Finding("vectors", "note", words)


def virtual() -> Finding:
    """Return whether this is a virtual machine, whose host may take its cores away."""
    if not machine.flags():
        return Finding("machine", "note", "not visible whether it is virtual")
    if "hypervisor" in machine.flags():
        return Finding("machine", "note", "virtual: other work of the host shows as steal time only")
    return Finding("machine", "ok", "not virtual, as far as it tells")


def steadiness(measure: Callable[[], float] = calibrate) -> list[Finding]:
    """Time the calibration loop again and again on one core, and tell how steady that is."""
    with machine.staying_on_a_core():
        measure()  # compiled now
        before, wall, busy = timing.steal_seconds(), time.perf_counter(), time.process_time()
        taken = [measure() for _ in range(CALIBRATIONS)]
        wall, busy = time.perf_counter() - wall, time.process_time() - busy
        lost = timing.steal_seconds() - before
    told = [steal(lost / wall)] if hasattr(psutil.cpu_times(), "steal") else []
    return [scatter(taken), share(busy / wall), *told]


def scatter(taken: Sequence[float]) -> Finding:
    """Judge how much the same computation varies."""
    deciles = quantiles(taken, n=10, method="inclusive")
    spread, slowest = deciles[-1] / deciles[0] - 1, max(taken) / median(taken) - 1
    words = (
        f"{median(taken) * 1e3:.2f} ms, varying by {spread:.1%} between deciles, the slowest by {slowest:.0%}"
    )
    bad = spread > LARGEST_SCATTER
    return _judged("calibration", words, bad, "fix the frequency and stop what else runs")


def share(part: float) -> Finding:
    """Judge how much of a core a busy process gets."""
    words = f"{min(part, 1.0):.1%} of a core for a busy process"
    return _judged("share", words, part < LEAST_SHARE, "stop what else runs on this machine")


def steal(part: float) -> Finding:
    """Judge how much time the host took away from a virtual machine."""
    words = f"{part:.1%} of a core taken by the host"
    return _judged("steal time", words, part > LARGEST_STEAL, "use a machine of its own")


def _judged(name: str, words: str, bad: bool, advice: str) -> Finding:
    return Finding(name, "bad" if bad else "ok", words, advice * bad)


def _quota() -> float | None:
    """Return how many cores' time the control group grants, if it limits it."""
    granted, _, period = _read(Path("/sys/fs/cgroup/cpu.max")).partition(" ")
    return int(granted) / int(period) if granted.isdigit() and period.isdigit() else None


def _running() -> int | None:
    """Return the number of runnable processes, this one among them, where the system tells."""
    lines = _read(STAT).splitlines()
    return next((int(line.split()[1]) for line in lines if line.startswith("procs_running")), None)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
