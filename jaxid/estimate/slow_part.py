"""What is slow in a residual above white noise of the sensor: motion that the model does not make, rather than noise."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..logs.noise import usual_size, white_level

Array = NDArray[np.float64]

SLOW = 0.6
"""Correlation of neighbouring residuals above which they wander rather than jitter."""
_WHITE = 1.12
"""Scatter between neighbouring residuals, in units of the noise by third differences, up to which the sensor's noise is
white: that of first-order noise is 1.17 for a correlation of 0.6 and 1.28 for 0.97."""
_CERTAIN = 4.0
"""Standard errors by which neighbours must be related for that to be no chance."""
_DOUBT = 2.0
"""Standard errors by which samples two apart must share more than in first-order noise."""


def slow_part(parts: Sequence[Array], noise: float, step: float = 0.0) -> tuple[float, float]:
    """What is slow in a residual, root mean square in units of white noise: of all logs, and of the one that has most of it.

    Between neighbouring samples hardly anything slow changes, so that they differ by the sensor's noise alone. Zero where
    they differ by more than white noise does: then the noise itself is coloured, or the model's errors are fast. How much
    that is, the residual says as well as the data, and better where the data's own third differences hold quick motion; but
    of a coarse sensor, whose rounding is no white noise from sample to sample, no less than its `step` makes on average.
    Zero, too, where what neighbours share is gone as soon as in first-order noise: that of a correlation below a half, as a
    filtered gyro has, is all but white in its differences.
    """
    changes = [np.diff(part) for part in parts]
    white = min(noise, max(white_level(np.concatenate(parts)), step / np.sqrt(12.0)) or noise)
    if usual_size(np.concatenate(changes)) > _WHITE * np.sqrt(2.0) * white:
        return 0.0, 0.0

    def common(parts: Sequence[Array], apart: int) -> tuple[float, float]:
        """Variance that samples so far `apart` share, and its standard error if they share none."""
        products = np.concatenate([part[apart:] * part[: len(part) - apart] for part in parts])
        products = products[np.isfinite(products)]
        if not len(products):
            return 0.0, np.inf
        return float(products.mean()), float(np.sqrt(np.mean(products**2) / len(products)))

    def shared(parts: Sequence[Array]) -> float:
        """Variance of what two neighbours share, where that is no chance and lasts longer than in first-order noise."""
        (every, _), (near, chance), (next_but_one, doubt) = (common(parts, apart) for apart in range(3))
        if near <= _CERTAIN * chance:
            return 0.0
        first_order = near <= SLOW * every and next_but_one <= near**2 / every + _DOUBT * doubt
        return 0.0 if first_order else near

    return np.sqrt(shared(parts)) / noise, np.sqrt(max(shared([part]) for part in parts)) / noise
