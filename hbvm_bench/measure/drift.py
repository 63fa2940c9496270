"""From an error over time to its growth: bounded, a power of t with its interval, exponential or a drift.

Round-off that is unbiased makes the error of a conserved quantity a random walk,
which grows like t^(1/2) (Brouwer's law); a biased rounding, or a method that does not conserve,
makes it grow like t; a fixed amplitude is what a symplectic method at a step that
resolves the motion shows before its round-off does. Several can act at once,
so each is fitted together with a floor, in logarithms, to the rms over windows of
time that are equally long in log t, and over trajectories from perturbed initial
conditions. The power of t alone does not tell a random walk from one that drifts
slowly: the mean over the initial conditions is tested against its own scatter
before a growth is named.

D. Brouwer, "On the accumulation of errors in numerical integration",
The Astronomical Journal 46 (1937) 149-153.
"""

import math
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace
from numpy.typing import ArrayLike, NDArray

from hbvm_bench.store.records import ErrorGrowth
from problems.errors import InputError

Array = NDArray[np.float64]

PER_DECADE = 4  # windows
FEWEST_WINDOWS = 6
FEWEST_ABOVE = 3  # windows in which a growth is above its floor: fewer may be an outlier
SHORTEST = 1.2  # decades
NOISE = 0.05  # of the logarithm: no fit is taken to be better than this
CONFIDENCE = 0.95
STANDARD_ERRORS = 3.0  # from 0, beyond which a mean is called a drift
EVIDENCE = 6.0  # by which the criterion of a growth must beat a bound: strong evidence
STEEPEST = 12.0  # powers of t, and e-foldings times 40, that are searched

KINDS: dict[str, str] = {
    "bounded": "stays within a bound",
    "power": "grows like a power of t",
    "exponential": "grows like exp(t)",
    "drift": "drifts: the mean over the initial conditions is not 0",
}
CURVES = [kind for kind in KINDS if kind != "drift"]  # that are fitted; a drift is told by the mean


def drifts(growth: ErrorGrowth) -> bool | None:
    """Whether the mean is more than `limit` standard errors from 0; ``None`` for one trajectory."""
    if growth.mean is None or growth.mean_error is None:
        return None
    return abs(growth.mean) > limit(growth.starts) * growth.mean_error


def rms(errors: ArrayLike) -> Array:
    """Return the root mean square over trajectories, shape (n,), of errors of shape (starts, n)."""
    rows = np.atleast_2d(np.asarray(errors, dtype=np.float64))
    largest = np.max(np.abs(rows), axis=0)
    scale = np.where(largest > 0.0, largest, 1.0)
    return scale * np.sqrt(np.mean((rows / scale) ** 2, axis=0))


def limit(starts: int) -> float:
    """Return how many standard errors a mean over ``starts`` may be from 0 and not be called a drift.

    `STANDARD_ERRORS`, or Student's 95 % quantile where few trajectories make that larger.
    """
    return max(STANDARD_ERRORS, _quantile(starts))


def _quantile(starts: int) -> float:
    from scipy.special import stdtrit  # few cases ask for a fit, and every process would load it

    return float(stdtrit(starts - 1, 0.5 + CONFIDENCE / 2))


def false_alarms(starts: int) -> float:
    """Return the share of errors without a drift whose mean exceeds `limit` by chance."""
    from scipy.special import stdtr  # as in _quantile

    return 2.0 * float(stdtr(starts - 1, -limit(starts)))


def told(starts: int) -> str:
    """Return when a mean over at least two initial conditions is called a drift, and how often wrongly."""
    return (
        f"A drift is reported where the mean over the {starts} initial conditions is more than "
        f"{limit(starts):.3g} standard errors from 0; without a drift, chance exceeds this in "
        f"{100.0 * false_alarms(starts):.1g} % of all runs"
    )


def uncertainty(starts: int) -> str:
    """Return the uncertainty of a root mean square over initial conditions; nothing for one."""
    share = 100.0 / math.sqrt(2.0 * starts) if starts > 1 else 0.0
    return (
        f" A root mean square over {starts} initial conditions has an uncertainty of ±{share:.0f} %."
        if share
        else ""
    )


def mean(t: ArrayLike, errors: ArrayLike) -> ErrorGrowth:
    """Return the mean growth of the errors to the end over the initial conditions, without a fit.

    The offset of a trajectory, its mean over the first window of time, is taken off:
    what the evaluation of an invariant adds throughout is no drift. End less begin is
    the maximum-likelihood estimate of the drift of a random walk. Times and errors are as of `fit`.
    """
    times = np.asarray(t, dtype=np.float64)
    rows = np.atleast_2d(np.asarray(errors, dtype=np.float64))
    first = _windows(times)[1] == 0
    first[-1] = False
    ends = rows[:, -1] - rows[:, first].mean(axis=1)
    value, n = float(np.mean(ends)), ends.size
    error = math.sqrt(float(np.sum((ends - value) ** 2)) / (n * (n - 1))) if n > 1 else math.inf
    span = float(times[-1] - times[first].mean())
    rate, low, high = (_finite(bound / span) for bound in (value, *_interval(value, error, n)))
    mean_growth = ErrorGrowth(
        mean=value, mean_error=_finite(error), positive=int(np.sum(ends > 0.0)), starts=n
    )
    return replace(mean_growth, rate=rate, rate_low=low, rate_high=high, end=float(times[-1]))


def fit(t: ArrayLike, errors: ArrayLike, *, signed: bool = True) -> ErrorGrowth:
    """Find how an error grows with time.

    Signed errors that grow by a power of t are called a drift where the mean over the initial conditions
    is one (`drifts`). Samples that are not finite end the series; fewer than two leave no growth.

    Parameters
    ----------
    t : array_like, shape (n,)
        Times since the start, positive and ascending; best log-spaced.
    errors : array_like, shape (n,) or (starts, n)
        Errors, one row per trajectory.
    signed : bool
        Whether the errors have a sign, so that a mean drift has a meaning.

    Returns
    -------
    ErrorGrowth
        Intervals from leaving out one trajectory at a time, or from the scatter about the fit
        where there are fewer than three.

    Raises
    ------
    problems.errors.InputError
        If the shapes do not fit, or the times are not positive and ascending.
    """
    times, rows = _checked(t, errors)
    good = np.isfinite(rows).all(axis=0)
    size = good.size if good.all() else int(np.argmin(good))
    if size < 2:
        return ErrorGrowth(why="the error is not finite from the first samples on", starts=len(rows))
    times, rows = times[:size], rows[:, :size]
    fitted = mean(times, rows) if signed else ErrorGrowth(end=float(times[-1]), starts=len(rows))
    if size < good.size:
        fitted = replace(fitted, why=f"only to t = {times[-1]:.4g}, where the error is last finite")
    middle, label = _windows(times)
    values = _windowed(rows, label)
    if not np.any(values):
        return replace(fitted, kind="bounded", slope=0.0, slope_low=0.0, slope_high=0.0)
    kept = values > 0.0
    decades = math.log10(times[-1] / times[0])
    if kept.sum() < FEWEST_WINDOWS or decades < SHORTEST:
        why = (
            f"a fit of the error growth needs samples in {FEWEST_WINDOWS} windows over {SHORTEST} decades "
            "of time"
        )
        return replace(fitted, why=why, floor=float(values[kept].min()))
    fits = {kind: _fitted(kind, middle[kept], values[kept]) for kind in CURVES}
    slope, low, high = _slope(times, rows, fits["power"])
    kind = min(CURVES, key=lambda name: fits[name].score)
    if fits[kind].score > fits["bounded"].score - EVIDENCE or fits[kind].above < FEWEST_ABOVE:
        kind = "bounded"
    if drifts(fitted) and kind == "power":
        fits["drift"], kind = fits["power"], "drift"
    floor = math.exp(fits[kind].parameters[0])
    return replace(
        fitted,
        kind=kind,
        slope=slope,
        slope_low=_finite(low),
        slope_high=_finite(high),
        floor=floor,
        exponential_rate=_finite(_rate_of_growth(times, rows, floor)) if kind == "exponential" else None,
        reached=0.0 if kind == "bounded" else math.exp(fits[kind].parameters[1]),
    )


@dataclass(frozen=True)
class _Fit:
    parameters: tuple[float, ...]  # ln of the floor, ln of the growth at the end, power or e-foldings
    score: float  # Bayesian information criterion
    spread: float  # standard error of the last parameter
    above: int  # windows in which the growth has passed the floor


def _fitted(kind: str, t: Array, values: Array) -> _Fit:
    """Fit ln sqrt(floor^2 + g(t)^2) to ln of the values by least squares."""
    from scipy.optimize import least_squares  # as in _quantile

    logs = np.log(values)
    n = logs.size
    if kind == "bounded":
        return _Fit((float(np.mean(logs)),), _score(logs - np.mean(logs), 1), 0.0, 0)
    low, high = float(logs.min()), float(logs.max())
    over = t / t[-1] - 1.0 if kind == "exponential" else np.log(t / t[-1])

    def grown(p: Array) -> Array:  # ln g(t); at the end of the interval it is p[1]
        return p[1] + p[2] * over

    def residual(p: Array) -> Array:
        return 0.5 * np.logaddexp(2.0 * p[0], 2.0 * grown(p)) - logs

    # The floor lies not far below the least value: below that it has no effect and no meaning.
    bounds = [(low - 3.0, high + 1e-9), (low - 3.0, high + 3.0)]
    guesses = [[low - 1.0, float(logs[-1])], [low, float(logs[-1])]]
    bounds.append((0.0, STEEPEST) if kind == "power" else (0.0, 40.0 * STEEPEST))
    steep = (0.5, 1.5) if kind == "power" else (2.0, 20.0)
    guesses = [[*guess, value] for guess in guesses for value in steep]
    lower, upper = (np.array(side) for side in zip(*bounds, strict=True))
    best = min(
        (least_squares(residual, np.clip(g, lower, upper), bounds=(lower, upper)) for g in guesses),
        key=lambda candidate: candidate.cost,
    )
    parameters = best.x.tolist()
    normal = best.jac.T @ best.jac + 1e-12 * np.eye(best.x.size)
    variance = max(2.0 * best.cost / max(n - best.x.size, 1), NOISE**2) * np.linalg.inv(normal)[-1, -1]
    above = int(np.sum(grown(best.x) > best.x[0]))
    score = _score(residual(best.x), best.x.size)
    return _Fit(tuple(parameters), score, math.sqrt(max(variance, 0.0)), above)


def _rate_of_growth(t: Array, rows: Array, floor: float) -> float:
    """Return the rate of an exponential from the samples well above the floor; windows are too wide."""
    values = rms(rows)
    clear = values > 10.0 * floor
    if clear.sum() < 2:
        return math.nan
    return float(np.polyfit(t[clear], np.log(values[clear]), 1)[0])


def _score(residual: NDArray[np.floating], parameters: int) -> float:
    n = residual.size
    return n * math.log(float(np.mean(residual**2)) + NOISE**2) + parameters * math.log(n)


def _slope(t: Array, rows: Array, whole: _Fit) -> tuple[float, float, float]:
    """Return the power of t and its interval, by the jackknife over trajectories where there are three."""
    slope = whole.parameters[2]
    starts = len(rows)
    if starts < 3:
        return (slope, slope - 2.0 * whole.spread, slope + 2.0 * whole.spread)
    middle, label = _windows(t)
    each = []
    for left_out in range(starts):
        values = _windowed(np.delete(rows, left_out, axis=0), label)
        kept = values > 0.0
        if kept.sum() >= FEWEST_WINDOWS:
            each.append(_fitted("power", middle[kept], values[kept]).parameters[2])
    if len(each) < 3:
        return (slope, -math.inf, math.inf)
    n = len(each)
    error = math.sqrt((n - 1) / n * float(np.sum((np.array(each) - np.mean(each)) ** 2)))
    return (slope, *_interval(slope, error, n))


def _interval(mean: float, error: float, count: int) -> tuple[float, float]:
    if count < 2:
        return -math.inf, math.inf
    half = _quantile(count) * error
    return mean - half, mean + half


def _windows(t: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the middle of each window that has samples, and the number of the window of each sample."""
    number = np.floor((np.log10(t) - math.log10(t[0])) * PER_DECADE + 1e-9).astype(np.intp)
    number[-1] = number[-2]  # the end alone is no window
    present, label = np.unique(number, return_inverse=True)
    middle = np.array([math.exp(np.mean(np.log(t[label == i]))) for i in range(present.size)])
    return middle, label


def _windowed(rows: Array, label: NDArray[np.intp]) -> Array:
    return np.array([rms(rows[:, label == i].reshape(-1, 1))[0] for i in range(int(label.max()) + 1)])


def _checked(t: ArrayLike, errors: ArrayLike) -> tuple[Array, Array]:
    times = np.asarray(t, dtype=np.float64)
    rows = np.atleast_2d(np.asarray(errors, dtype=np.float64))
    if times.ndim != 1 or times.size < 2 or rows.ndim != 2 or rows.shape[1] != times.size:
        raise InputError(f"errors of shape {rows.shape} do not belong to times of shape {times.shape}.")
    if not (times[0] > 0.0 and np.all(np.diff(times) > 0.0)):
        raise InputError(f"times since the start must be positive and ascending; the first is {times[0]:g}.")
    return times, rows


def _finite(number: float) -> float | None:
    return float(number) if math.isfinite(number) else None
