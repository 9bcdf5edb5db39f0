"""A channel over its own instants: in a log of several clocks, rows in which a slower sensor says nothing are no gaps."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_GAP = 3.5
"""Times the usual interval between two samples, from which on nothing is drawn between them."""
_MOST_ROWS = 10


def on_own_clock(time: Array, values: Array) -> tuple[Array, Array]:
    """Times and values [n] of a line through what a channel measured, of rows `time`, `values` [T] (NaN: nothing there).

    A line through all rows would end at every one that is another sensor's. This one breaks, by a NaN, where the channel's
    own samples lie farther apart than they usually do.
    """
    there = np.isfinite(values)
    x, y = np.asarray(time, float)[there], np.asarray(values, float)[there]
    if len(x) < 3:
        return x, y
    steps = np.diff(x)
    breaks = np.flatnonzero(steps > _GAP * np.median(steps)) + 1
    return np.insert(x, breaks, (x[breaks - 1] + x[breaks]) / 2), np.insert(y, breaks, np.nan)


def own_interval(times: Sequence[Array], parts: Sequence[Array]) -> float:
    """The usual interval between two samples of a channel, of all logs together."""
    steps = [np.diff(time[np.isfinite(part)]) for time, part in zip(times, parts, strict=True)]
    every = np.concatenate([*steps, np.zeros(0)])
    return float(np.median(every)) if every.size else 1.0


def own_rows(time: Array, values: Array, interval: float) -> Array:
    """What a channel measured, `values` [T] with NaN in rows that are another sensor's, in rows that are `interval` apart.

    Neighbours are then neighbours; a sample that is missing stays missing.
    """
    there = np.isfinite(values)
    if there.all() or not there.any():
        return values
    x, y = np.asarray(time, float)[there], np.asarray(values, float)[there]
    row = np.round((x - x[0]) / interval).astype(int)
    if row[-1] > _MOST_ROWS * len(y):  # long breaks: what is on both sides of one is hardly related
        return y
    rows = np.full(row[-1] + 1, np.nan)
    rows[row] = y
    return rows
