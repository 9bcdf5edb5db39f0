"""Samples that jump away from their neighbours and come back: what no moving mass does, and no sensor's filter.

They are found against the median of the neighbours (the filter of Hampel, Journal of the American Statistical Association 69,
1974), which slow errors of a model, and slow noise, pass.
"""

import numpy as np
from numpy.typing import NDArray

from ..logs.noise import usual_size

_EACH_SIDE = 3
"""Neighbours on each side: up to as many samples in a row may be off."""
_FAR = 4.5
"""Standard deviations; one normal sample in 150,000 is as far off."""


def _around(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The median of every sample and its neighbours [T]."""
    around = np.pad(values, _EACH_SIDE, mode="reflect")
    return np.median(np.lib.stride_tricks.sliding_window_view(around, 2 * _EACH_SIDE + 1), axis=1)


def jumping(residual: NDArray[np.float64], least: float = 0.0) -> NDArray[np.bool_]:
    """Which samples of a channel's residual [T], NaN where nothing was measured, jump and come back: by far more than others
    do, and than `least`."""
    there = np.flatnonzero(np.isfinite(residual))
    found = np.zeros(residual.shape, dtype=bool)
    if there.size <= 2 * _EACH_SIDE:
        return found
    jump = residual[there] - _around(residual[there])
    found[there] = np.abs(jump) > _FAR * max(least, usual_size(jump))
    return found


def without_jumps(residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """The residual [T] with the median of its neighbours in place of every sample that jumps by more than all of it is wide."""
    if not np.isfinite(residual).any():
        return residual
    jumps = jumping(residual, least=usual_size(residual))
    if not jumps.any():
        return residual
    there = np.isfinite(residual)
    mended = residual.copy()
    mended[there] = np.where(jumps[there], _around(residual[there]), residual[there])
    return mended
