"""What the metrics are: from what was measured to a number, or to the sentence why there is none."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure import drift
from hbvm_bench.measure.measured import Measured

Quantity = Callable[[Measured], float | str]

PLANETOID_Z = 8  # component of Sitnikov's state
LOADED = "another case had loaded it; the timing pass measures it"


def error_max(invariant: str) -> Quantity:
    """Return the quantity: largest error of an invariant."""

    def quantity(m: Measured) -> float | str:
        if invariant not in m.errors:
            return f"the problem declares no {invariant.replace('_', ' ')}"
        return _largest(m.errors[invariant], m.t)

    return quantity


def counter(name: str, words: str) -> Quantity:
    """Return the quantity: a counter, which not every library has."""

    def quantity(m: Measured) -> float | str:
        number = getattr(m.counters, name)
        return f"not applicable: the library counts no {words}" if number is None else float(number)

    return quantity


def energy_end(m: Measured) -> float | str:
    """Return the energy error at the last sample."""
    if "energy" not in m.errors:
        return "the problem declares no energy"
    return float(m.errors["energy"][-1]) if m.t.size else "no samples"


def guard_max(m: Measured) -> float | str:
    """Return the largest value of any symmetry guard."""
    if not m.guards:
        return "the problem declares no symmetry guard"
    found = [_largest(values, m.t) for values in m.guards.values()]
    sentences = [value for value in found if isinstance(value, str)]
    return sentences[0] if sentences else max(value for value in found if not isinstance(value, str))


def distance_max(m: Measured) -> float | str:
    """Return the largest distance of a body from the origin."""
    return _largest(m.distance, m.t)


def position_end(m: Measured) -> float | str:
    """Return the position error at the end time."""
    return _no_reference_at_end(m) or float(m.position[-1])


def position_max(m: Measured) -> float | str:
    """Return the largest position error over the times of the reference."""
    if m.reference is None:
        return "no stored reference for this problem"
    return _largest(m.position, m.position_t)


def position_mean(m: Measured) -> float | str:
    """Return the geometric mean of the position errors at the times of the reference after the start.

    At round-off a single one of them is a matter of luck.
    """
    if why := _no_reference_at_end(m):
        return why
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(m.position[m.position_t != m.problem.t0]))))


def energy_rms(m: Measured) -> float | str:
    """Return the root mean square over the starts of the energy error at the end."""
    errors = m.drift.get("energy", np.empty((0, 0)))
    return float(drift.rms(errors)[-1]) if errors.size else "no further starts were asked for"


def energy_bias(m: Measured) -> float | str:
    """Return the mean energy error over the starts, in units of what is called a drift."""
    law = m.laws.get("energy")
    if law is None or law.mean is None or not law.mean_error:
        return "a mean needs several starts"
    return abs(law.mean) / (drift.limit(law.starts) * law.mean_error)


def energy_rate_least(m: Measured) -> float | str:
    """Return the least drift of the energy, without sign, that its interval over the starts allows."""
    law = m.laws.get("energy")
    if law is None or law.rate_low is None or law.rate_high is None:
        return "an interval needs several starts"
    return max(law.rate_low, -law.rate_high, 0.0)


def phase_end(m: Measured) -> float | str:
    """Return how far in time the run is ahead of or behind the reference at the end time."""
    return _no_reference_at_end(m) or abs(float(m.phase[-1]))


def phase_max(m: Measured) -> float | str:
    """Return the largest error of the phase over the times of the reference."""
    if m.reference is None:
        return "no stored reference for this problem"
    return _largest(m.phase, m.position_t)


def others_max(m: Measured) -> float | str:
    """Return the largest error of any invariant but the energy."""
    names = [name for name in m.errors if name != "energy"]
    if not names:
        return "the problem has no invariant but the energy"
    found = [_largest(m.errors[name], m.t) for name in names]
    sentences = [value for value in found if isinstance(value, str)]
    return sentences[0] if sentences else max(value for value in found if not isinstance(value, str))


def reversal(m: Measured) -> float | str:
    """Return the distance from the start after integrating there and back."""
    return m.reversal


def law_number(name: str) -> Quantity:
    """Return the quantity: a number of the law of the energy's error, such as its ``slope``."""

    def quantity(m: Measured) -> float | str:
        law = m.laws.get("energy")
        if law is None:
            return "no law was sought"
        number = getattr(law, name)
        return law.why or "the samples do not say" if number is None else float(number)

    return quantity


def peak_memory(m: Measured) -> float | str:
    """Return the largest resident memory of the process, in MiB."""
    return "not measured" if m.peak_gib is None else 1024.0 * m.peak_gib


def compiled(cached: bool) -> Quantity:
    """Return the quantity: seconds of compilation, cold or from a cache."""

    def quantity(m: Measured) -> float | str:
        rounds = m.timing.rounds if m.timing is not None else []
        found = [one for one in (m.compile, *(r.compile for r in rounds)) if one is not None]
        if not found:
            return LOADED
        if all(one.cached is None for one in found):
            return "nothing is compiled at run time"
        seconds = sorted(one.seconds for one in found if one.cached is cached)
        if seconds:
            return seconds[(len(seconds) - 1) // 2]
        return "compiled code was not in a cache" if cached else "compiled code was in the cache already"

    return quantity


def axis_end(m: Measured) -> float | str:
    """Return Sitnikov's z at the end time."""
    return float(m.y[-1, PLANETOID_Z]) if m.complete else f"ended at t = {m.t_stop:.4g}"


def axis_error(m: Measured) -> float | str:
    """Return the distance of Sitnikov's z at the end time from the reference."""
    if (why := _no_reference_at_end(m)) or m.reference is None:
        return why
    (last,) = np.flatnonzero(m.reference.t == m.t[-1])
    high, low = m.reference.high[last, PLANETOID_Z], m.reference.low[last, PLANETOID_Z]
    return abs(float((m.y[-1, PLANETOID_Z] - high) - low))


def warm_seconds(m: Measured) -> float | str:
    """Return the median of all timing samples."""
    if m.timing is None:
        return "not timed"
    return m.timing.summary.get("median", m.timing.why or "not timed")


def throughput(m: Measured) -> float | str:
    """Return the trajectories of an ensemble per second."""
    if m.trajectories == 1:
        return "one trajectory, no ensemble"
    seconds = warm_seconds(m)
    return seconds if isinstance(seconds, str) else m.trajectories / seconds


def compile_seconds(m: Measured) -> float | str:
    """Return the seconds of compilation: the median of the timing pass where there was one."""
    compiled = m.timing.compile if m.timing is not None and m.timing.compile else m.compile
    if compiled is None:
        return LOADED
    if compiled.cached is None:
        return "nothing is compiled at run time"
    return compiled.seconds


def _largest(values: NDArray[np.float64], t: NDArray[np.float64]) -> float | str:
    if values.size == 0:
        return "no samples"
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        return f"not finite from t = {t[bad[0]]:.4g}"
    return float(np.max(np.abs(values)))


def _no_reference_at_end(m: Measured) -> str:
    if m.reference is None:
        return "no stored reference for this problem"
    if not m.complete:
        return f"ended at t = {m.t_stop:.4g}"
    if m.position_t.size == 0 or m.position_t[-1] != m.t[-1]:
        return "the reference does not reach the end time"
    return ""
