"""Has a residual the shape of a sensor's noise: as much on every log and in every stretch, forgotten as a filter forgets?

Errors of a model come where the motion makes them, and a disturbance of the motion is as slow as the robot's inertia. A
sensor's filter is a short autoregression or an average over some samples, or faster than the robot. Every test here gives a
probability by chance; the level is for the caller.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..._distributions import chi_squared_tail, normal_tail
from ...estimate.noise_colour import Colour, colour_of
from ...estimate.portmanteau import forgotten, robust_portmanteau, steadiness
from ...logs.noise import usual_size, white_level

Array = NDArray[np.float64]

_SIMPLE = 2
"""Order up to which an autoregression that leaves nothing is a sensor's filter."""
_AVERAGED = 12
"""Samples over which a sensor's filter reaches that is none of those: as far as `noise_colour` looks back."""
_LAGS, _BURST_LAGS = 20, 25
_SLACK = 0.05
"""Ratio (its logarithm) of two levels of one noise that a wrong autoregression may explain."""
_SHORTEST, _BLOCK_LAGS = 8, 3
"""Samples of the shortest means that tell slow from fast, and the lags over which these are held to be white."""
_DOUBT = 10.0
"""Means are few, and slow noise easily passes for none: so many times the probability of others is asked of them."""
_FASTER = 0.5
"""Memory of the noise in time constants of the robot up to which no force makes it: inertia would have smoothed that."""
_WHITE_SHARE = 0.1
"""Share of white noise in coloured noise that an autoregression's own error may show."""
_ROUNDING = 1.5
"""What a sensor's step adds may be so many times what rounding of quick signals does (step^2 / 12)."""


def even(colour: Colour, parts: Sequence[Array]) -> float:
    """p value of every log having as much of the noise, `parts` [T], as its own differences say.

    A sensor may be noisier on one log; its differences are, too. Of noise with the autocorrelations rho, a variance of n
    samples has 1 + 2 sum rho^2 times the uncertainty of independent ones, that from third differences 2.31 times (see
    `noise_error`).
    """
    rho = colour.correlations
    inflated = 1.0 + 2.0 * float(np.sum(rho[1:] ** 2))
    third = float(np.sqrt((20.0 - 30.0 * rho[1] + 12.0 * rho[2] - 2.0 * rho[3]) / 20.0))
    # The residuals' third differences, as the noise of the data is estimated; usual sizes, so that outliers do not count.
    sizes = [usual_size(own) / max(white_level(own), 1e-300) * third for own in parts]
    errors = [np.sqrt((inflated + 2.31) / (2.0 * len(own))) for own in parts]
    off = [max(abs(np.log(size)) - _SLACK, 0.0) / error for size, error in zip(sizes, errors, strict=True)]
    return min(2.0 * float(normal_tail(max(off))) * len(off), 1.0)


def alike(colour: Colour, parts: Sequence[Array], level: float) -> list[tuple[Colour, list[Array]]]:
    """The logs' noise, `parts` [T], with its colour: all of them together where they have as much of it by their differences
    (at `level`), else every log with its own, as where a sensor's filter was changed between two days."""
    if even(colour, parts) >= level:
        return [(colour, list(parts))]
    return [(colour_of([own]), [own]) for own in parts]


def steady(parts: Sequence[Array]) -> float:
    """p value of no stretch having more of the noise, `parts` [T] of each log, than others."""
    return steadiness(parts, _BURST_LAGS)


def fast(colour: Colour, memory: float) -> bool:
    """Whether the noise is faster than any force that the robot's inertia smooths, `memory` samples long, could make it."""
    return colour.memory < _FASTER * memory


def of_counts(colour: Colour, memory: float) -> bool:
    """Whether it is like a speed's from counts: what one sample has too much the next has too little, and none at rest.

    No force makes such noise, so that where it comes says nothing.
    """
    return colour.correlation < 0.0 and fast(colour, memory)


def _brief(parts: Sequence[Array], samples: int) -> float:
    """p value of noise having nothing left that lasts for `samples`: means over as many, every other one, are white."""
    means = []
    for own in parts:
        blocks = (
            (own[: len(own) // samples * samples] if samples else own[:0]).reshape(-1, max(samples, 1)).mean(axis=1)
        )
        means.append(blocks[::2] / max(usual_size(own), 1e-300))
    if samples < _SHORTEST or sum(map(len, means)) < 4 * _BLOCK_LAGS:
        return 0.0
    statistic, freedom = robust_portmanteau(means, _BLOCK_LAGS)
    return float(chi_squared_tail(statistic, freedom)) / _DOUBT


def beside_white(colour: Colour, rounding: float) -> bool:
    """Whether it is slow noise with white noise on top, more than the sensor's step adds: a share `rounding` of the variance.

    A sensor's own noise is hardly both; a disturbance of the motion, seen by a sensor with white noise, is.
    """
    return colour.white_share > _WHITE_SHARE + _ROUNDING * rounding


def briefly(colour: Colour, parts: Sequence[Array], memory: float, rounding: float) -> float:
    """p value of the noise, `parts` [T] of each log, being forgotten within some samples, or sooner than any force is."""
    if not fast(colour, memory):
        return 0.0 if beside_white(colour, rounding) else forgotten(parts, _AVERAGED, _LAGS)
    return max(_brief(parts, round(_FASTER * memory)), forgotten(parts, _AVERAGED, _LAGS))


def filtered_simply(colour: Colour, white: Sequence[Array], rounding: float) -> float:
    """p value of a short autoregression leaving nothing of it but innovations, `white` [T] of each log."""
    # Rounding on top of a short autoregression makes a longer one of it.
    if colour.order > (_SIMPLE if rounding < 0.1 * _WHITE_SHARE else _AVERAGED) or beside_white(colour, rounding):
        return 0.0
    statistic, freedom = robust_portmanteau(white, _LAGS)
    return float(chi_squared_tail(statistic, max(freedom - colour.order, 1)))
