"""Short linear filters from rest, by `scipy.linalg`: `scipy.signal` has them, and imports `scipy.stats` and much else."""

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Array = NDArray[np.float64]


def lagged(values: Array, decay: float) -> Array:
    """First-order lag from rest, `y[k] = decay y[k-1] + (1 - decay) values[k]`, of `values` [T, ...] along their first axis."""
    bands = np.ones((2, len(values)))
    bands[1] = -decay
    return linalg.solve_banded((1, 0), bands, (1.0 - decay) * values, check_finite=False)


def filtered(taps: Array, values: Array) -> Array:
    """Moving average `y[k] = sum_i taps[i] values[k - i]` from rest, of `values` [T]."""
    return np.convolve(values, taps)[: len(values)]


def autoregressive(taps: Array, values: Array) -> Array:
    """`sum_i taps[i] y[k - i] = values[k]` from rest, of `values` [T, ...] along their first axis; `taps[0]` is 1."""
    bands = np.repeat(np.asarray(taps, float)[:, None], len(values), axis=1)
    return linalg.solve_banded((len(taps) - 1, 0), bands, values, check_finite=False)
