"""The measurement noise, estimated from the data alone.

Third differences (divided by the times between the samples, where these are uneven) remove what is smooth over four
samples and leave white noise, amplified by a known factor. Samples around a change of the input, the larger ones first,
are left out where enough remain, since a motion has a kink there. The estimate needs no model, so a model's residual can
be judged by it. What a slower sensor repeats is counted once; where it leaves cells empty, its own samples are the
neighbours; a signal that does not move says nothing, and no noise is finer than the sensor's step (its
standard deviation over sqrt(12), Widrow and Kollar 2008). Where a robot moves far from one reading to the next, differences
show its motion, and what an autoregression with the inputs leaves of it is the bound (`innovations.py`). Noise that is
correlated over several samples is underestimated (of first-order noise with a correlation of 0.8 a third is seen): from one
log it cannot be told from motion, from the residual of a fit it can.
"""

from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from .innovations import not_foretold
from .log import Log, LogSet

_SPIKE = 3.5
_KEPT = 0.99693  # root of 1 - 2 z phi(z) / (2 Phi(z) - 1) at z = 3.5
_REPEATED = 0.3
"""Share of samples equal to the one before from which a signal may be that of a slower sensor, or a coarse one."""
_REGULAR = 0.8
"""Share of a slower sensor's values that come at its own interval, give or take one sample."""
_FINE = 3.0
"""Typical change of a value, in the finest steps, above which repeats show the sensor's rate and not its step."""
_VALUES = 8
"""Values that hardly repeat below which it may be chance that they are multiples of a step."""
_FEWEST = 8
"""Differences of one log below which they are not counted."""
_FEWEST_CALM, _ENOUGH = 60, 1000
"""Differences without a change of the input from which others are left out, and from which no others are added."""
_NOTHING = 1e-12  # noise of a channel that is zero throughout, of which nothing is known
_THE_SAME = 1e-6, 1e-9
"""Differences, in shares of the largest value, below which two are one: as single precision computes them from counts in more
than one way, and as written."""
_LEAST = 1e-6
"""Noise in units of the signal's root mean square below which a channel counts as free of noise (a simulation)."""
_MOVING = 0.02
"""Level of third differences, in units of the signal's root mean square, above which they may show motion."""
_FAR_LESS = 0.5
"""Share of their level below which what is not foretold is the noise. What the differences of a counter's values are off by is
foretold to 0.6 of it, the next one being off by as much the other way."""


def sensor_step(y: NDArray[np.float64]) -> float:
    """The step [y's unit] of a coarse sensor or a counter, of which all of a channel's values are multiples, however seldom one
    repeats; zero where there is none.

    They are counted from each value to the next: files give so many digits that thousands of steps are no whole number of the
    one between two neighbours. Of values that hardly repeat there must be some, and not evenly spaced, as those of a signal are
    that changes by the same from sample to sample.
    """
    y = y[np.isfinite(y)]
    values = np.unique(y)
    return next((step for share in _THE_SAME if (step := _step_of(values, len(y), share)) > 0.0), 0.0)


def _step_of(values: NDArray[np.float64], samples: int, share: float) -> float:
    """The same of the sorted `values` of so many samples, of which those are the same that differ by this share of the
    largest."""
    steps = np.diff(values)
    told = steps > share * np.max(np.abs(values), initial=0.0)
    if np.count_nonzero(told) < 2:
        return 0.0
    least, count = steps[told], 1 + np.count_nonzero(told)
    each = np.round(steps / np.median(least[least < 1.5 * np.min(least)]))
    hardly = samples < 2 * count
    if hardly and (count < _VALUES or (count == samples and np.all(each == each[0]))):
        return 0.0
    numbers, off = np.cumsum(each), values[1:] - values[0]
    step = float(numbers @ off / (numbers @ numbers))
    return step if np.max(np.abs(off / step - numbers)) < 0.1 else 0.0


def updates_of(y: NDArray[np.float64]) -> NDArray[np.int64] | None:
    """The samples at which a slower sensor gave its values, None where every sample is its own."""
    finite = np.flatnonzero(np.isfinite(y))
    changed = finite[1:][np.diff(y[finite]) != 0]
    if len(changed) < 20 or len(changed) > (1 - _REPEATED) * len(finite):
        return None
    gaps = np.diff(changed)
    usual = float(np.median(gaps))
    steps = np.abs(np.diff(y[changed]))
    if usual < 2 or np.mean(np.abs(gaps - usual) <= 1) < _REGULAR:
        return None
    return changed if np.median(steps) > _FINE * sensor_step(y) else None


def _sparse(y: NDArray[np.float64]) -> bool:
    """Whether most measured samples have no measured neighbours: of a sensor slower than the log, its other cells empty."""
    there = np.isfinite(y)
    four = there[:-3] & there[1:-2] & there[2:-1] & there[3:]
    return bool(2 * np.count_nonzero(four) < np.count_nonzero(there))


def as_sampled(y: NDArray[np.float64]) -> NDArray[np.float64]:
    """A signal as its own sensor samples it: without the empty cells of a log that is faster; else as it is."""
    return y[np.isfinite(y)] if _sparse(y) else y


def third_differences(y: NDArray[np.float64], time: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Third divided differences of a signal, in units in which white noise has its own standard deviation."""
    if len(y) < 4:
        return np.zeros(0)
    if time is None:
        return (y[:-3] - 3 * y[1:-2] + 3 * y[2:-1] - y[3:]) / np.sqrt(20.0)
    t = np.stack([time[k : len(time) - 3 + k] for k in range(4)])
    apart = t[:, None] - t[None, :] + np.eye(4)[..., None]
    shares = 1.0 / np.prod(apart, axis=1)
    values = np.stack([y[k : len(y) - 3 + k] for k in range(4)])
    return np.sum(shares * values, axis=0) / np.sqrt(np.sum(shares**2, axis=0))


def _differences(y: NDArray[np.float64], inputs: NDArray[np.float64], time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Third differences of one channel. Those across an input change are left out where at least 60 remain, but for those
    across the smallest changes where fewer than `_ENOUGH` remain: where these show hardly more than the error of the few
    lets expect, they make the level surer."""
    moved = np.cumsum(np.vstack([np.zeros(inputs.shape[1]), np.abs(np.diff(inputs, axis=0))]), axis=0)
    updates = np.flatnonzero(np.isfinite(y)) if _sparse(y) else updates_of(y)
    if updates is not None:
        y, moved, time = y[updates], moved[updates], time[updates]
    third = third_differences(y, time)
    still = (y[:-3] == y[1:-2]) & (y[1:-2] == y[2:-1]) & (y[2:-1] == y[3:])
    telling = np.isfinite(third) & ~still
    change = np.diff(moved, axis=0)
    kink = np.maximum(change[:-2], change[1:-1])  # at one of the two inner samples
    calm = telling & ~np.any(kink > 0, axis=1)
    kept = third[calm]
    if kept.size < _FEWEST_CALM:
        return third[telling]
    others = np.flatnonzero(telling & ~calm)
    if kept.size < _ENOUGH and others.size:
        size = np.linalg.norm(kink[others] / np.maximum(np.max(kink, axis=0), 1e-300), axis=1)
        small = third[others[np.argsort(size, kind="stable")[: _ENOUGH - kept.size]]]
        if usual_size(small) < usual_size(kept) * (1.0 + 1.5 * _error(kept.size)):
            return np.concatenate([kept, small])
    return kept


def _error(count: int) -> float:
    """Standard deviation, as a share, of a level that so many third differences show.

    Of n third differences (1, -3, 3, -1) of white noise the variance has 1 + 2 (0.75^2 + 0.3^2 + 0.05^2) = 2.31 times the
    uncertainty of independent samples, by their autocorrelations.
    """
    return float(np.sqrt(2.31 / 2.0 / count))


def usual_size(values: NDArray[np.float64]) -> float:
    """Standard deviation about zero of the finite `values` within 3.5 robust ones (median absolute deviation).

    Of all of them where they are mostly zero. A few large ones, and heavy tails, do not count.
    """
    values = values[np.isfinite(values)]
    robust = 1.4826 * float(np.median(np.abs(values)))
    if robust < 1e-9 * float(np.max(np.abs(values))):
        return float(np.sqrt(np.mean(values**2)))  # quantised: what is left is the rounding of the decimal steps
    # Among normal numbers the mean square of those within the limit is a little below the variance.
    usual = values[np.abs(values) < _SPIKE * robust] if robust > 0 else values
    return float(np.sqrt(np.mean(usual**2))) / _KEPT


def white_level(values: NDArray[np.float64]) -> float:
    """Standard deviation of the white noise on evenly sampled `values`, those not finite left out; zero if there are few."""
    values = values[np.isfinite(values)]
    return usual_size(third_differences(values)) if len(values) >= 4 else 0.0


class _Shown(NamedTuple):
    """What one channel of one log shows: measured samples, differences that tell its noise, and their level."""

    samples: int
    differences: int
    level: float


def _of_noise(third: NDArray[np.float64], y: NDArray[np.float64], log: Log) -> float:
    """The level that third differences show, or what is not foretold of the signal where that is far less: then the robot moves
    so far from one reading to the next that differences show its motion."""
    level = usual_size(third)
    if not level > _MOVING * float(np.sqrt(np.nanmean(y**2))):
        return level
    foretold = not_foretold(y, log.inputs, updates_of(y))
    return foretold if foretold < _FAR_LESS * level else level


_known: WeakKeyDictionary[Log, tuple[_Shown, ...]] = WeakKeyDictionary()


def _shown(log: Log) -> tuple[_Shown, ...]:
    """What every channel shows, worked out once for a log, which does not change: every stage of a fit asks for it."""
    if log not in _known:
        found = []
        for y in log.outputs.T:
            third = _differences(y, log.inputs, log.time)
            # The neighbouring rounding errors of a counter are alike while it creeps.
            level = max(_of_noise(third, y, log), sensor_step(y) / np.sqrt(12.0)) if third.size >= _FEWEST else 0.0
            found.append(_Shown(int(np.isfinite(y).sum()), third.size, level))
        _known[log] = tuple(found)
    return _known[log]


def _together(logs: list[Log], index: int) -> float:
    """The noise of one channel of logs that are too short to tell it each by itself, such as windows of a few samples."""
    third = np.concatenate([_differences(log.outputs[:, index], log.inputs, log.time) for log in logs])
    return max(usual_size(third), sensor_step(np.concatenate([log.outputs[:, index] for log in logs])) / np.sqrt(12.0))


def noise_level(logs: LogSet | Log) -> dict[str, float]:
    """Standard deviation of the measurement noise of each measured channel, NaN for a channel no log holds.

    The root mean square over the logs of differences within 3.5 robust standard deviations (median absolute deviation),
    so that a spike does not count. A channel whose differences are mostly zero (quantised) falls back to their plain
    root mean square.
    """
    each = [logs] if isinstance(logs, Log) else list(logs)
    levels: dict[str, float] = {}
    for index, channel in enumerate(each[0].channels.measured):
        mine = [_shown(log)[index] for log in each]
        enough = [own for own in mine if own.differences >= _FEWEST]
        counts = sum(own.differences for own in enough)
        squares = sum(own.differences * own.level**2 for own in enough)
        if not enough and sum(own.differences for own in mine) >= _FEWEST:
            counts, squares = 1, _together(each, index) ** 2
        still = any(own.samples >= 11 for own in mine)
        levels[channel] = float(np.sqrt(squares / counts)) if counts else 0.0 if still else float("nan")
    return levels


def noise_error(logs: LogSet | Log) -> dict[str, float]:
    """Standard deviation of each channel's `noise_level` as a share of it, NaN where there is none."""
    each = [logs] if isinstance(logs, Log) else list(logs)
    found = {}
    for index, channel in enumerate(each[0].channels.measured):
        counts = [_differences(log.outputs[:, index], log.inputs, log.time).size for log in each]
        used = sum(count for count in counts if count >= _FEWEST)
        found[channel] = _error(used) if used else float("nan")
    return found


def noise_scale(logs: LogSet | Log, otherwise: LogSet | Log | None = None) -> dict[str, float]:
    """`noise_level` as something to divide by: never below a millionth of the signal, and never zero or NaN.

    The one yardstick of fits, comparisons and explanations. Noise-free simulations have the millionth; a channel that was
    never measured has the scale that the logs `otherwise` show, or one.
    """
    each = [logs] if isinstance(logs, Log) else list(logs)
    scale = dict.fromkeys(each[0].channels.measured, 1.0) if otherwise is None else noise_scale(otherwise)
    for name, level in noise_level(logs).items():
        y = np.concatenate([log.output(name) for log in each])
        if np.isfinite(y).any():
            rms = float(np.sqrt(np.nanmean(y**2)))
            scale[name] = max(level if np.isfinite(level) else 0.0, _LEAST * rms) or _NOTHING
    return scale
