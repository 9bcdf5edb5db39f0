"""Readings that count: of a position that a counter tells, one of each stretch in which it stands.

A counter's rounding error is noise from sample to sample only while steps pass between them (Widrow and Kollar 2008). Where
the robot stands, or creeps, it is the same error again and again: a hundred equal readings tell no more of the position than
one, and as a hundred they would pull the parameters to whatever fits the place within a step at which the robot happens to
have stopped, with standard errors to match. The reading in the middle of its stretch is nearest to the middle of the step.
"""

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from .log import Log
from .noise import sensor_step

_STANDS = 4
"""Equal readings in a row from which a counter stands: noise of a step's size makes as many seldom."""

_known: WeakKeyDictionary[Log, NDArray[np.bool_]] = WeakKeyDictionary()


def once(y: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of a counter's measured values [T] count: the middle one of `_STANDS` and more that are equal, and all others."""
    there = np.flatnonzero(np.isfinite(y))
    counts = np.isfinite(y)
    starts = np.flatnonzero(np.append(True, np.diff(y[there]) != 0)) if len(there) else np.zeros(0, dtype=int)
    for begin, end in zip(starts, np.append(starts[1:], len(there)), strict=True):
        if end - begin >= _STANDS:
            counts[there[begin:end]] = False
            counts[there[(begin + end - 1) // 2]] = True
    return counts


def counting(log: Log) -> NDArray[np.bool_]:
    """Which measurements of a log count [T, channels.measured], worked out once for a log, which does not change."""
    if log not in _known:
        counts = np.isfinite(log.outputs)
        for name in log.channels.positions:
            column = log.channels.measured.index(name)
            if sensor_step(log.outputs[:, column]) > 0.0:
                counts[:, column] = once(log.outputs[:, column])
        counts.flags.writeable = False
        _known[log] = counts
    return _known[log]
