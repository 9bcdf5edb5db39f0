r"""What the noise of one measured speed does in the equations of the others.

`refined_instruments` filters every equation so that the noise of its own speed is its error, unchanged. The other speeds
stand in it as well (a caster that both speeds turn, centrifugal terms), and what their noise adds lasts as long as the
equation remembers: little beside the sample's own noise, but slow, as instruments are. So it tells in their sum.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

Array = NDArray[np.float64]


class Coupling(NamedTuple):
    """How the filtered equations of N samples and nv speeds pass on noise.

    `growth` [N, nv]: from a sample to the next; `at_start`, `at_end` [N, nv, nv]: what noise of each speed (last axis) at
    both ends of the interval after a sample adds to every speed's equation, its own left out; `run` [N, nv]: number of the
    run of intervals that a sample belongs to, -1 for none.
    """

    growth: Array
    at_start: Array
    at_end: Array
    run: NDArray[np.int64]


def coupling(
    growth: Array, at_start: Array, at_end: Array, run: NDArray[np.int64], moved: NDArray[np.bool_]
) -> Coupling:
    """From slopes of each speed's equation by all speeds; speeds that have not `moved` are zero, so without noise."""
    own = np.eye(growth.shape[1], dtype=bool)

    def others(slope: Array) -> Array:
        return np.where(own | ~moved[:, None, :] | ~np.isfinite(slope), 0.0, slope)

    return Coupling(np.where(np.isfinite(growth), growth, 0.0), others(at_start), others(at_end), run)


def noise_weights(
    through: Coupling,
    instruments: Array,
    noise: Array,
    equation: NDArray[np.int64],
    sample: NDArray[np.int64],
) -> Array:
    """How far `instruments.T @ error` moves [N, nv, n] by one standard deviation of each speed's noise at each sample.

    `instruments` [K, n] and the errors of `equation` [K] at `sample` [K] are in units of `noise` [nv], the standard
    deviation of each speed's. Adjoint of the filter, so that it costs as much as one more filtering.
    """
    (N, nv), n = through.growth.shape, instruments.shape[1]
    weights = np.zeros((N, nv, n))
    weights[sample, equation] = instruments
    if not (through.at_start.any() or through.at_end.any()):
        return weights
    found = weights.copy()
    for i in range(nv):
        goes_on = (through.run[:-1, i] >= 0) & (through.run[:-1, i] == through.run[1:, i])
        band = np.ones((2, N))
        band[0, 1:] = np.where(goes_on, -through.growth[:-1, i], 0.0)
        # What an error that enters at a sample does to the sum in all that follows of its run.
        later = np.asarray(solve_banded((0, 1), band, weights[:, i])) / noise[i]
        after = np.where(goes_on[:, None], later[1:], 0.0)
        for j in range(nv):
            found[:-1, j] -= noise[j] * through.at_start[:-1, i, j, None] * after
            found[1:, j] -= noise[j] * through.at_end[:-1, i, j, None] * after
    return found
