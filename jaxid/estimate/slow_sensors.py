"""The noise of sensors too slow for the motion, which their readings alone do not tell.

Between samples that are as far apart as the robot takes to answer, it moves as no difference of four of them tells from noise;
what a model that follows it leaves is less.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..logs import Log, LogSet
from ..logs.noise import as_sampled, third_differences, updates_of, usual_size
from .confidence.agreement import errors_of
from .judge import with_integration
from .rounding import step_of

_FEW_DIFFERENCES, _SLOW_SENSOR = 30, 0.7
"""Differences from which the white part of a residual is known, and its share of the noise that the readings show below which
some of that was motion."""
Array = NDArray[np.float64]


def no_larger_than_left(logs: LogSet, simulated: Sequence[Array], noise: Mapping[str, float]) -> dict[str, float]:
    """The `noise` of each channel, as the readings show it, no larger than the white part of what a model leaves of the `logs`
    (`simulated`, [T, channels.measured] of each), where that is much less; not below the simulation's own error."""
    found = dict(noise)
    each = [(log, errors_of(log, y)) for log, y in zip(logs, simulated, strict=True)]
    for c in noise:
        with np.errstate(over="ignore", invalid="ignore"):  # where the simulation runs away
            parts = [third_differences(_at_readings(log, c, own[c])) for log, own in each if c in own]
            third = np.concatenate([np.zeros(0), *parts])
            third = third[np.isfinite(third)]
            white = usual_size(third) if len(third) >= _FEW_DIFFERENCES else np.inf
        left = with_integration(logs, {**noise, c: max(white, step_of(logs, c) / np.sqrt(12.0))})[c]
        if 0.0 < left < _SLOW_SENSOR * noise[c]:
            found[c] = left
    return found


def _at_readings(log: Log, channel: str, error: Array) -> Array:
    """Errors [T] of a channel where its sensor measured: without empty cells, and without what a slower one repeats."""
    updates = updates_of(log.output(channel))
    return as_sampled(error) if updates is None else error[updates]
