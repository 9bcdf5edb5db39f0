"""What rounding to a sensor's step does to a residual (Widrow and Kollár, Quantization Noise, 2008).

Rounding of a signal that changes slowly is no noise: it stays the same for many samples in a row, and is a function of the
signal. Where the simulation is known to a fraction of a step, so is what rounding makes of it on average.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ..logs import LogSet
from ..logs.noise import sensor_step

Array = NDArray[np.float64]
_BELOW = np.geomspace(0.01, 0.6, 18)
"""Standard deviations of the noise below the rounding that are tried, in steps."""
_FAR = 1e-6
"""Probability of a reading that the model cannot explain, so that a few do not say all."""
_SEEN = 0.02
"""Share of a residual's variance from which rounding is to be seen in it."""
_STEPS_OFF = np.arange(1, 5)


def step_of(logs: LogSet, channel: str) -> float:
    """The step of a channel's sensor, the coarsest of all logs; zero where there is none, or no such channel."""
    if channel not in logs.channels.measured:
        return 0.0
    return max(sensor_step(log.output(channel)) for log in logs)


def shows(step: float, left: float) -> bool:
    """Whether rounding to a `step` is to be seen in a residual whose root mean square is `left`."""
    return step**2 / 12.0 > _SEEN * left**2


def noise_below(model: Sequence[Array], read: Sequence[Array], step: float) -> float:
    """The likeliest standard deviation, in steps, of the noise that was there before rounding."""
    off = np.concatenate([y - m for m, y in zip(model, read, strict=True)]) / step
    off = off[np.isfinite(off)]
    likely = [np.sum(np.log(np.maximum(ndtr((off + 0.5) / s) - ndtr((off - 0.5) / s), _FAR))) for s in _BELOW]
    return float(_BELOW[int(np.argmax(likely))])


def mean_reading(values: Array, read: Array, step: float, below: float) -> Array:
    """What a sensor with this `step`, which `read` its multiples, shows on average of `values` with noise of `below` steps."""
    shift = (values - read) / step
    whole = np.floor(shift)
    part = (shift - whole)[..., None]
    above = np.sum(ndtr((part - _STEPS_OFF + 0.5) / below), axis=-1)
    under = np.sum(ndtr(-(part + _STEPS_OFF - 0.5) / below), axis=-1)
    return read + step * (whole + above - under)


def mean_rounding(model: Sequence[Array], read: Sequence[Array], step: float) -> list[Array]:
    """By how much a sensor with this `step`, whose readings are `read`, shows more than the `model` on average."""
    below = noise_below(model, read, step)
    return [mean_reading(m, y, step, below) - m for m, y in zip(model, read, strict=True)]


def less_rounding(model: Sequence[Array], errors: Sequence[Array], step: float) -> list[Array]:
    """A channel's `errors`, of the `model` from what was read, less what rounding to the `step` makes of the model on
    average, where that is to be seen in them."""
    off = np.concatenate(list(errors))
    off = off[np.isfinite(off)]
    if not (step and off.size and shows(step, float(np.sqrt(np.mean(off**2))))):
        return list(errors)
    read = [m - error for m, error in zip(model, errors, strict=True)]
    rounding = mean_rounding(model, read, step)
    return [error + own for error, own in zip(errors, rounding, strict=True)]
