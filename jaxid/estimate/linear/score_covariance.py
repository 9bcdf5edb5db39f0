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
from scipy.stats import t as student

from ..result import NORMAL_95

Array = NDArray[np.float64]
_SHARE, _POWER = 0.41, 2.0 / 3.0
"""Cosines for T samples, at most 0.41 T^(2/3): section 4 of that paper."""


def score_covariance(scores: Array, log: NDArray[np.int64], memory: int) -> tuple[Array, float]:
    """Covariance [n, n] of `scores.sum(axis=0)` and its degrees of freedom.

    `scores` [N, n] are those of each sample, in order of time, zero where a sample says nothing; `log` [N] numbers
    the logs, which are independent of one another. What correlates over less than `memory` samples is accounted for.
    No degrees of freedom: too few samples to tell.
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
        phase = np.pi * (np.arange(T) + 0.5) / T
        waves = np.sqrt(2.0) * np.cos(np.arange(1, count + 1)[:, None] * phase)
        transformed = waves @ own  # each has the variance of the plain sum
        total += transformed.T @ transformed / count
        freedom += count
    return total, float(freedom)


def widened(covariance: Array, freedom: float) -> Array:
    """The covariance whose normal 95 % interval is as wide as Student's with that many degrees of freedom."""
    return covariance * (float(student.ppf(0.975, max(freedom, 1.0))) / NORMAL_95) ** 2
