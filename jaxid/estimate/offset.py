"""A residual that is not zero on average: an offset of its sensor, or what a model lacks all the time.

Tests of whiteness look for how a residual changes about its own mean, and a constant does not change.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .residual_tests import independent

Array = NDArray[np.float64]

_CERTAIN = 4.0
"""Standard errors of a mean beyond which it is no chance."""


def offset(parts: Sequence[Array], noise: float, above: float) -> float:
    """The mean of a residual, one part [T] of each log, that is what makes it `above` so many times the `noise`; else 0."""
    values = np.concatenate(parts)
    mean, left = float(np.nanmean(values)), float(np.nanstd(values))
    if not np.hypot(mean, left) > above * noise >= left:
        return 0.0
    samples = max(independent([part - mean for part in parts]), 1.0)
    return mean if abs(mean) > _CERTAIN * left / np.sqrt(samples) else 0.0
