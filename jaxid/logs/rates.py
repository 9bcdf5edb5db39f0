"""Measured positions: turns that a sensor does not count, and speeds where no speed was measured, and what that costs."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from .finding import LogError
from .noise import sensor_step

Vector = Float[np.ndarray, " n"]


_PERIODS = ((2.0 * np.pi, 0.05), (360.0, 0.5), (65536.0, 0.0))
"""A turn [rad, degrees] and a counter of 16 bits, and by how much positions may lie beyond their range."""
_BITS = (8, 32)
"""Of the shortest and the longest counter that are told by their steps alone."""


def _counter(positions: Vector) -> float:
    """Where a counter begins anew: the least power of two that holds all positions, if these are whole numbers and none of
    their steps across its end, put together, is much longer than the others; 0 for what is none."""
    low, high = float(np.min(positions)), float(np.max(positions))
    if not np.all(positions == np.round(positions)):
        return 0.0
    for bits in range(_BITS[0], _BITS[1] + 1):
        period = 2.0**bits
        if (low >= 0 and high < period) or (low >= -period / 2 and high < period / 2):
            steps = np.abs(np.diff(positions))
            far = steps > 0.5 * period
            usual = float(np.max(steps[~far], initial=0.0))
            meets = usual < 0.25 * period and np.all(period - steps[far] <= 1.5 * usual)
            return period if far.any() and meets else 0.0
    return 0.0


def unwrapped(positions: Vector) -> Vector:
    """Positions without the jumps of angles at a turn, in rad or degrees, and of counters at their end, a power of two.

    They count as wrapped where all lie in one turn, from zero or about it, and steps are longer than half of it.
    """
    if len(positions) < 2:
        return positions
    if period := _counter(positions):
        return np.unwrap(positions, period=period)
    low, high, step = float(np.min(positions)), float(np.max(positions)), float(np.max(np.abs(np.diff(positions))))
    for period, margin in _PERIODS:
        within = (low >= -margin and high <= period + margin) or max(-low, high) <= period / 2 + margin
        whole = period != 65536.0 or bool(np.all(positions == np.round(positions)))
        if within and whole and step > 0.5 * period:
            return np.unwrap(positions, period=period)
    return positions


_LONG = 2.5
"""Intervals, in usual ones, from which on a sensor that starts again at every turn may have lost one."""


def whole_way(time: Vector, positions: Vector, name: str, column: str) -> tuple[Vector, str]:
    """Positions [T], NaN where not measured, without the jumps at a turn or at a counter's end, and a sentence without file
    and full stop for a gap in them, across which nobody counted the turns; empty where there is none."""
    there = np.isfinite(positions)
    whole = unwrapped(positions[there])
    if np.array_equal(whole, positions[there]):
        return positions, ""
    found, steps = positions.copy(), np.diff(time[there])
    found[there] = whole
    longest = float(np.max(steps))
    if longest <= _LONG * float(np.median(steps)):
        return found, ""
    return found, (
        f"{name!r} begins anew at every turn (or where its counter ends) of {column!r}, and in a gap of {longest:.3g} s nobody "
        "counted these; cut the log there unless it stood still"
    )


def rate(time: Vector, positions: Vector, name: str, column: str, path: Path) -> tuple[Vector, str]:
    """Rates of change of the finite `positions` by central differences (second order, also at uneven `time` [s]), NaN at the
    first and the last, and a sentence without file and full stop that says what this does to the noise.

    Steps q of a counter, whose rounding errors have the variance q^2/12 and are independent of one another, become noise of
    q / (sqrt(6) 2 h) at samples h apart. Raises `LogError` for fewer than three positions.
    """
    if len(positions) < 3:
        raise LogError(
            f"{path}: {column!r} has {len(positions)} position(s), too few to differentiate for {name!r}; map another one."
        )
    with np.errstate(all="ignore"):  # times that repeat are an error of their own
        speeds = np.gradient(positions, time)
    speeds[[0, -1]] = np.nan  # a one-sided difference there would be another, coarser sensor
    width = 2.0 * float(np.median(np.diff(time)))
    step = sensor_step(positions)
    noise = f"its steps of {step:.3g} become noise of {step / np.sqrt(6.0) / width:.3g}" if step else "its noise grows"
    return speeds, (
        f"{name!r} is differentiated from the position {column!r} over {width:.3g} s, so that {noise}, related from sample to "
        "sample; map a measured speed if there is one"
    )
