r"""How far scores that are correlated in time scatter when they are added up: what standard errors of linear methods need.

An estimate is off by A⁻¹ sum(scores), a score being a row of regressors (or instruments) times its residual. Residuals
of neighbouring rows share samples (integrals over consecutive intervals do: correlation -1/2), add up noise, and carry
whatever the model lacks. So the sum's covariance is that of the scores at frequency zero, taken as the mean of their
first cosine transforms over each log: positive semidefinite, no model of the colour, exact where the sum telescopes
(E. Lazarus, D. J. Lewis, J. H. Stock and M. W. Watson, "HAR inference: recommendations for practice", Journal of Business
& Economic Statistics 36, 2018: equal-weighted cosines, with the t quantile of as many degrees of freedom).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from ..._distributions import student_quantile
from ..result import NORMAL_95

Array = NDArray[np.float64]
_SHARE, _POWER = 0.41, 2.0 / 3.0
"""Cosines for T samples, at most 0.41 T^(2/3): section 4 of that paper."""

_NEGLIGIBLE = 1e-2
_TOLD = 2.0
"""Standard deviations by which an autocorrelation of white noise is exceeded: then it is none."""


def score_covariance(scores: Array, log: NDArray[np.int64], memory: int) -> tuple[Array, float]:
    """Covariance [n, n] of `scores.sum(axis=0)` and its degrees of freedom.

    `scores` [N, n] are those of each sample, in order of time, zero where a sample says nothing; `log` [N] numbers
    the logs, which are independent of one another. What correlates over less than `memory` samples is accounted for.
    The estimate has set n combinations of the scores to zero, which are counted out. No degrees of freedom: too few
    samples to tell.
    """
    n = scores.shape[1]
    total, freedom = np.zeros((n, n)), 0
    for number in np.unique(log):
        own = scores[log == number]
        own = own[: 1 + int(np.max(np.flatnonzero(own.any(axis=1)), initial=-1))]
        T = len(own)
        count = min(int(_SHARE * T**_POWER), T // memory)
        if count < 1:
            continue
        transformed = np.sqrt(0.5) * dct(own, axis=0)[1 : count + 1]  # each has the variance of the plain sum
        total += transformed.T @ transformed / count
        freedom += count
    left = max(freedom - n, 0)
    return total * (freedom / max(left, 1)), float(left)


def widened(covariance: Array, freedom: float) -> Array:
    """The covariance whose normal 95 % interval is as wide as Student's with that many degrees of freedom."""
    return covariance * (float(student_quantile(0.975, max(freedom, 1.0))) / NORMAL_95) ** 2


def _autocovariance(residual: Array, seen: NDArray[np.bool_], log: NDArray[np.int64]) -> Array:
    """Autocovariance of a residual [N] from lag zero on, up to where it is no longer told from white noise, and from there
    on falling exponentially."""
    longest = max(len(residual) // 8, 1)
    products, pairs = np.zeros(longest), np.zeros(longest)
    for number in np.unique(log):
        own = log == number
        there, size = seen[own].astype(float), 2 * int(own.sum())
        shown = min(longest, size // 2)
        for total, signal in ((products, np.where(seen[own], residual[own], 0.0)), (pairs, there)):
            total[:shown] += np.fft.irfft(np.abs(np.fft.rfft(signal, size)) ** 2, size)[:shown]
    pairs = np.rint(pairs)
    values = products / np.maximum(pairs, 1.0)
    # Parameters and starts have taken up slow noise, which leaves a little negative correlation: that counts as none.
    told = (pairs > 0.0) & (values > _TOLD * values[0] / np.sqrt(np.maximum(pairs, 1.0)))
    ends = np.flatnonzero(~told[1:])
    found = values[: 1 + int(ends[0])] if len(ends) else values
    if len(found) <= 2:
        return found
    # What lies below the noise of the estimate is not nothing: it goes on falling as it did before.
    fall = (found[-1] / found[0]) ** (1.0 / (len(found) - 1))
    beyond = int(min(np.log(_NEGLIGIBLE) / np.log(fall) if 0.0 < fall < 1.0 else 0.0, len(residual) // 8))
    return np.append(found, found[-1] * fall ** np.arange(1, beyond + 1))


def stationary_covariance(
    weights: Array,
    residual: Array,
    equation: NDArray[np.int64],
    sample: NDArray[np.int64],
    logs: NDArray[np.int64],
    taken: Array,
) -> tuple[Array, float]:
    """Covariance [n, n] of the sum of noise times `weights` [N, kinds, n], and its degrees of freedom, for noise whose
    correlation depends on the lag alone.

    The noise is known by the `residual` [K] of `equation` [K] at `sample` [K]; `logs` [N] is the log of each sample. Exact
    for white noise; coloured noise has the power that its autocovariance gives, channel by channel. `taken`: how many
    numbers were fitted to each equation's residual, which took up as much of its slow noise.
    """
    N, n = len(logs), weights.shape[2]
    total, freedom = np.zeros((n, n)), 0.0
    for kind in np.unique(equation):
        rows = equation == kind
        Z, r, seen = weights[:, kind], np.zeros(N), np.zeros(N, bool)
        r[sample[rows]], seen[sample[rows]] = residual[rows], True
        covariance = _autocovariance(r, seen, logs)
        independent = seen.sum() / (2.0 * covariance.sum() / max(covariance[0], 1e-300) - 1.0)
        left = max(independent - taken[kind], 0.25 * independent)
        covariance *= independent / left
        freedom += left
        if len(covariance) == 1:
            total += covariance[0] * Z.T @ Z
            continue
        for number in np.unique(logs):
            own = Z[logs == number]
            size, lags = 2 * len(own), min(len(covariance), len(own))
            wave = np.zeros(size)
            wave[:lags] = covariance[:lags]
            wave[-lags + 1 :] = covariance[lags - 1 : 0 : -1]
            power = np.maximum(np.fft.fft(wave).real, 0.0)
            transformed = np.fft.fft(own, size, axis=0)
            total += np.real(np.conj(transformed).T @ (power[:, None] * transformed)) / size
    return total, freedom
