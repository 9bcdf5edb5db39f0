"""What the checks need to know of any robot's motion: which outputs are positions, the speed of each, how fast it responds.

Nothing here is in seconds or metres of its own: times are counted in the log's own response time and sizes in the log's own
noise, so that a watch's motor and a mining truck are looked at alike.
"""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..logs.log import Log
from ..logs.noise import white_level

Array = NDArray[np.float64]

_LENGTHS_AND_ANGLES = {"m", "cm", "mm", "um", "km", "in", "ft", "rad", "mrad", "deg", "rev", "turn", "turns"}


def is_position(log: Log, name: str) -> bool:
    """Whether an output is a length or an angle, by its stated unit; an output without a unit is taken for a speed."""
    unit = log.channels.units.get(name, "").replace(" or ", " ").split()
    return bool(unit) and set(unit) <= _LENGTHS_AND_ANGLES


def is_planar(log: Log) -> bool:
    """Whether the outputs are speeds of a body on a floor: metres a second beside radians a second, or those of several wheels'
    rims, as stated."""
    units = [log.channels.units.get(name) for name in log.channels.mixing if name in log.measured]
    return {"m/s", "rad/s"} <= set(units) or units.count("m/s") > 1


def _slope(log: Log, filled: Array, width: int) -> Array:
    """Derivative of a position by a straight line through `width` samples on either side of each."""
    after = np.minimum(np.arange(len(log)) + width, len(log) - 1)
    before = np.maximum(np.arange(len(log)) - width, 0)
    return (filled[after] - filled[before]) / (log.time[after] - log.time[before])


def speed(log: Log, name: str) -> Array:
    """The speed that an output shows, `[T]`, NaN where not measured: itself, or a position's slope."""
    values = log.output(name)
    if not is_position(log, name):
        return values
    there = np.isfinite(values)
    if there.sum() < 3:
        return np.full_like(values, np.nan)
    filled = np.interp(log.time, log.time[there], values[there])  # a sensor may be slower than the log
    # The slope of noise falls with the width: wide enough for the slope to stand out, as far as the log is long.
    spread, width = white_level(values), 1
    while width < len(log) // 50 and spread > 0.05 * np.std(filled[width:] - filled[:-width]):
        width *= 2
    return np.where(there, _slope(log, filled, width), np.nan)


def _halfway(values: Array) -> float:
    """Samples after which a signal has forgotten half of where it was (its structure function, noise taken off)."""
    values = values[np.isfinite(values)]
    if len(values) < 20:
        return np.nan
    variance, white = float(np.var(values)), white_level(values) ** 2
    if variance <= 4 * white or variance == 0:
        return np.nan
    lags = np.unique(np.geomspace(1, len(values) // 2, 40).astype(int))
    for lag in lags:
        apart = values[lag:] - values[:-lag]
        if 0.5 * float(apart @ apart) / len(apart) - white >= 0.5 * (variance - white):
            return float(lag)
    return float(lags[-1])


_STRETCHED = 5
"""Rows at even intervals for a sample, at most: a clock that was set anew leaves a gap of years."""

_responses: WeakKeyDictionary[Log, int] = WeakKeyDictionary()
"""A log never changes, and most checks ask for this."""


def response(log: Log) -> int:
    """Samples in which the robot's speeds change noticeably, at least 4: the unit of time of the checks."""
    if log not in _responses:
        found = [_halfway(speed(log, name)) for name in log.channels.mixing if name in log.measured]
        found = [lag for lag in found if np.isfinite(lag)]
        _responses[log] = max(4, round(float(np.median(found)))) if found else max(4, len(log) // 50)
    return _responses[log]


@dataclass(frozen=True)
class Even:
    """A log at even intervals, inputs held and outputs taken from the nearest sample before."""

    interval: float
    inputs: Array  # [N, nu]
    rows: NDArray[np.int_]  # [N] sample of the log


def even(log: Log, most: int = 20_000) -> Even:
    """At the usual sampling interval; of a log of more than `most` samples, the part of so many in which the inputs vary most.
    Rows farther apart would show what an output does after an input beside it; they are so only where gaps would make them
    more than `_STRETCHED` times the samples."""
    first, last = 0, len(log)
    if last > most:
        size = np.ptp(log.inputs, axis=0)
        shares = log.inputs / np.where(size > 0, size, 1.0)
        begins = range(0, len(log) - most + 1, most)
        first = max(begins, key=lambda k: float(np.sum(np.var(shares[k : k + most], axis=0))))
        last = first + most
    time = log.time[first:last]
    duration = float(time[-1] - time[0])
    interval = max(log.sampling_interval, duration / (_STRETCHED * most))
    grid = time[0] + interval * np.arange(int(duration / interval * (1 + 1e-9)) + 1)
    rows = first + np.clip(np.searchsorted(time, grid + 1e-6 * interval, side="right") - 1, 0, len(time) - 1)
    return Even(interval, log.inputs[rows], rows)
