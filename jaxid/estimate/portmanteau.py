"""Tests of residuals whose noise may have heavy tails, outliers, and another size on every log or in every motion.

The usual test of autocorrelations (Ljung & Box, Biometrika 65, 1978) holds for independent samples of one distribution that
has four moments. Two outliers that happen to be neighbours, a log that is three times as noisy as the others, or stamps that
jitter, so that fast motion is noisier than slow, make it reject what is white. So every log is divided by the usual size of
its samples, these are cut off (Huber, 1964), and every lag's sum of products is held against the root of the sum of their
squares (Lobato, Nankervis & Savin, International Economic Review 42, 2001), which needs no equal variances.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz, toeplitz

from .._distributions import chi_squared_tail, normal_tail
from .._filters import filtered
from ..logs.noise import usual_size
from .jumps import without_jumps
from .residual_tests import autocorrelation

Array = NDArray[np.float64]

_CUT = 3.0
"""Usual sizes at which samples are cut off: of Gaussian noise three in a thousand are beyond."""
_FAR = 4.5
"""The same before a filter, which makes a burst of what was cut off: one Gaussian sample in 150,000."""
_ORDER, _WHITE = 10, 0.01
"""Order of the autoregression that bursts are looked for behind, and the share of white noise that it takes for granted."""
_OF_SQUARES = {2: 0.9911, 4: 0.0050, 6: 0.0027}
"""What powers of a Gaussian signal's autocorrelations the squares of it have, cut off at `_CUT` (Hermite's expansion)."""
_FLOOR = 0.1
"""Share of an autocorrelation's variance that is left to every combination of them, however narrow the noise's band."""


def levelled(parts: Sequence[Array], cut: float = _CUT) -> list[Array]:
    """The `parts` [T] of one signal, one of each log, in units of their own usual sizes, which are cut off at `cut`; NaN where
    not measured."""
    found = []
    for part in parts:
        size = usual_size(part) if np.isfinite(part).any() else 0.0
        found.append(np.clip(part / size, -cut, cut) if size > 0 else np.where(np.isfinite(part), 0.0, np.nan))
    return found


def robust_portmanteau(parts: Sequence[Array], lags: int) -> tuple[float, int]:
    """A statistic of autocorrelations about zero up to `lags`, chi-squared if there are none, and its degrees of freedom."""
    own = [np.nan_to_num(part) for part in levelled(parts)]
    statistic, freedom = 0.0, 0
    for lag in range(1, lags + 1):
        products = [part[lag:] * part[:-lag] for part in own if len(part) > lag]
        chance = sum(float(p @ p) for p in products)
        if chance > 0.0:
            statistic, freedom = statistic + sum(float(p.sum()) for p in products) ** 2 / chance, freedom + 1
    return statistic, freedom


def forgotten(parts: Sequence[Array], after: int, lags: int) -> float:
    """p value of the autocorrelations at `lags` lags beyond `after` samples being chance.

    Of an average over `after` samples they are nil.
    """
    own = levelled(parts)
    if max((len(part) for part in own), default=0) <= 2 * (after + lags):
        return 0.0
    rho, pairs = autocorrelation(own, after + lags, mean=0.0)
    covariance = _by_chance(rho[: after + 1], lags)
    values, vectors = np.linalg.eigh(covariance)
    beyond = rho[after + 1 :] * np.sqrt(pairs[after + 1 :])
    any_of_them = chi_squared_tail(
        float(np.sum((vectors.T @ beyond) ** 2 / np.maximum(values, _FLOOR * covariance[0, 0]))), lags
    )
    # What is slow is in all of them alike.
    slow = normal_tail(float(beyond.sum()) / np.sqrt(max(float(covariance.sum()), _FLOOR * lags * covariance[0, 0])))
    return float(min(2.0 * min(any_of_them, slow), 1.0))


def steadiness(parts: Sequence[Array], lags: int) -> float:
    """p value of a coloured residual, `parts` [T] of each log, coming in bursts by chance: of the squares of its innovations
    being related (McLeod & Li, Journal of Time Series Analysis 4, 1983).

    Innovations are those of an autoregression that takes some of the noise for white: of noise through a sharp filter, what is
    left in the filter's stop band would be blown up, and of a model's error the tiny part that is there. Where innovations are
    then not quite white, with the autocorrelations rho, the squares of Gaussian ones have about rho^2.
    """
    own = levelled([without_jumps(part) for part in parts], _FAR)
    if sum(map(len, own)) < 4 * lags:
        return 1.0
    rho, _ = autocorrelation(own, _ORDER, mean=0.0)
    column = rho[:_ORDER] + _WHITE * np.eye(1, _ORDER)[0]
    taps = np.concatenate([[1.0], -solve_toeplitz(column, rho[1:])])
    white = [np.where(np.isfinite(part), filtered(taps, np.nan_to_num(part)), np.nan)[_ORDER:] for part in own]
    white = levelled([part for part in white if len(part) > lags])
    squares = [np.square(part) for part in white]
    squares = [part - float(np.nanmean(part)) for part in squares if np.isfinite(part).any()]
    if not squares:
        return 1.0
    rho, _ = autocorrelation(white, lags, mean=0.0)
    of_squares, pairs = autocorrelation(squares, lags, mean=0.0)
    expected = np.sum([share * rho**power for power, share in _OF_SQUARES.items()], axis=0)
    left = (of_squares[1:] - expected[1:]) ** 2 * pairs[1:]
    covariance = _by_chance(expected, lags)
    # A sum of related squares has about the tail of a multiple of chi-squared (Satterthwaite, Biometrics Bulletin 2, 1946).
    mean, variance = float(np.trace(covariance)), 2.0 * float(np.sum(covariance**2))
    return float(chi_squared_tail(float(left.sum()) * 2.0 * mean / variance, 2.0 * mean**2 / variance))


def _by_chance(rho: Array, lags: int) -> Array:
    """Covariance [lags, lags], times their number of pairs, of estimated autocorrelations at `lags` lags far from zero of a
    signal whose own are `rho` [k] from lag zero on, and nil beyond (Bartlett, Supplement to the Journal of the Royal
    Statistical Society 8, 1946): those of the lags k and l share sum_j rho_j rho_(j + l - k)."""
    sides = np.concatenate([rho[:0:-1], rho])
    shared = np.correlate(sides, sides, "full")[len(sides) - 1 :]
    return toeplitz(np.pad(shared, (0, lags))[:lags])
