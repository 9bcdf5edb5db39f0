"""Covariance that stays right when neighbouring residuals are correlated.

(JᵀJ)⁻¹ holds for white residuals. Filtered sensors and whatever the model lacks make them coloured, and then it is too
small. Two sandwiches S⁻¹ B S⁻¹ put that right, and every parameter gets the larger of its two standard errors:

- B from the scores of blocks of time longer than the residual remembers: no model of the colour, also right where the
  residual depends on what the robot does, but few blocks know it roughly (Newey & West, Econometrica 55, 1987; blocks as in
  Liang & Zeger, Biometrika 73, 1986).
- B = Jᵀ Gamma J with the residual's autocovariance Gamma by lag: sharp, for noise that goes its own way. The parameters
  have taken up some of the noise, most of it slow; what they took is added back, to first order in J S⁻¹ Jᵀ.

Neither sees what differs between recordings of one robot (a load, a temperature, a floor): where the logs scatter by more
than the standard errors and by more than chance, these are widened to the scatter.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray

from ..._distributions import chi_squared_tail
from ..noise_colour import Colour, made_white
from .evaluation import sensitivities_at
from .problem import Problem, Structure, Unknowns

_MEMORIES = 10.0
"""Block length in units of the residual's correlation time: what correlates across borders is then a tenth."""
_SHORTEST, _FEWEST = 10, 30
"""Samples of the shortest block, and blocks that there must be at least."""
_ROUNDS = 3
"""Times that the noise taken up by the parameters is added back."""
_REMEMBERED = 0.05
"""Correlation below which the residual has forgotten."""
_FEW_LOGS = 2.0
"""Degrees of freedom below which logs are too few to be compared."""
_DISAGREE = 0.01
"""How often logs that differ by noise alone are said to disagree."""
_SINGULAR = 1e-13


def _points(samples: int) -> int:
    """Points of a Fourier transform of so many samples."""
    return 2 ** int(np.ceil(np.log2(samples)))


def _remembered(residual: Float[NDArray, "E T"], longest: int) -> Float[NDArray, " lags"]:
    """Correlation of a channel's residual with itself at lags 1, 2, ... (below `longest`) until it has forgotten, or at all of
    them where it does not."""
    longest = max(longest, 1)
    size, spectrum = _points(residual.shape[1] + longest), 0.0
    for own in residual:
        spectrum = spectrum + np.abs(np.fft.rfft(own, size)) ** 2
    products = np.fft.irfft(spectrum, size)[:longest]
    if not products[0] > 0.0:
        return np.zeros(0)
    correlation = products[1:] / products[0]
    forgotten = correlation < _REMEMBERED
    return correlation[: int(np.argmax(forgotten))] if forgotten.any() else correlation


def memory(residual: Float[NDArray, "E T ny"], mask: Bool[NDArray, "E T ny"]) -> float:
    """Correlation time of the slowest channel [samples]: one for white residuals."""
    channels = np.moveaxis(np.where(mask, residual, 0.0), -1, 0)
    return max(1.0 + 2.0 * float(np.sum(_remembered(own, own.shape[1] // 4))) for own in channels)


def _lags(residual: Float[NDArray, "E T ny"]) -> int:
    """Lags after which the residual of every channel has forgotten, twice over."""
    return 2 * max(1 + len(_remembered(own, own.shape[1] // 8)) for own in np.moveaxis(residual, -1, 0))


def _by_lag(a: NDArray[np.complex128], b: NDArray[np.complex128], size: int, lags: int) -> NDArray[np.float64]:
    """Sum over experiments, samples and columns of products of two signals that are 0 to `lags` samples apart, both ways
    [lags]. Of the signals' transforms [E, F, n] at `size` points, zeros behind them."""
    both = np.fft.irfft(np.einsum("efi,efi->f", a, np.conj(b)), size)
    found = both[:lags] + np.roll(both, -1)[::-1][:lags]
    found[0] = both[0]
    return found


def _autocovariance(residual: Float[NDArray, "E T"], pairs: NDArray[np.float64], lags: int) -> NDArray[np.float64]:
    size = _points(residual.shape[1] + lags)
    transformed = np.fft.rfft(residual, size, axis=1)[..., None]
    return _by_lag(transformed, transformed, size, lags) / pairs


def _pairs(mask: Bool[NDArray, "E T"], lags: int) -> NDArray[np.float64]:
    """Pairs of samples so many apart, both ways, of which both were measured; at least one."""
    size = _points(mask.shape[1] + lags)
    transformed = np.fft.rfft(mask.astype(float), size, axis=1)[..., None]
    return np.maximum(np.rint(_by_lag(transformed, transformed, size, lags)), 1.0)


def stationary(residual, jacobian, mask, inverse) -> NDArray[np.float64]:
    """B [n, n] of a residual whose autocovariance depends on the lag alone, channel by channel."""
    T, channels = residual.shape[1], range(residual.shape[-1])
    lags = _lags(residual)
    # 1 up to half of the lags, then down to 0: what is forgotten is only noise.
    taper = np.clip(2.0 * (1.0 - np.arange(lags) / lags), 0.0, 1.0)
    size = _points(T + lags)
    pairs = np.stack([_pairs(mask[..., y], lags) for y in channels])
    gamma = np.stack([_autocovariance(residual[..., y], pairs[y], lags) for y in channels])
    taken, total = np.zeros_like(gamma), np.zeros((jacobian.shape[-1],) * 2)
    for _ in range(_ROUNDS):
        weights = (gamma + taken) * taper
        spread = []
        for y in channels:
            kernel = np.zeros(size)
            kernel[:lags] = weights[y]
            kernel[size - lags + 1 :] = weights[y, :0:-1]
            answer = np.fft.rfft(jacobian[..., y, :], size, axis=1) * np.fft.rfft(kernel)[:, None]
            spread.append(np.fft.irfft(answer, size, axis=1)[:, :T])
        total = np.sum([np.einsum("eti,etj->ij", jacobian[..., y, :], spread[y]) for y in channels], axis=0)
        for y in channels:
            onto = np.fft.rfft(jacobian[..., y, :] @ inverse, size, axis=1)
            # H Gamma + Gamma H - H Gamma H along its diagonals, H = J S^-1 J^T
            lost = 2.0 * _by_lag(onto, np.fft.rfft(spread[y], size, axis=1), size, lags)
            taken[y] = (lost - _by_lag(onto @ total, onto, size, lags)) / pairs[y]
    return total


class Robust(NamedTuple):
    """Covariance [n, n] of the physical parameters for coloured residuals; how much the logs disagree beyond it.

    `between` [n]: ratio of each parameter's scatter between logs to what the covariance expects, where that is more than
    chance, else one. The covariance is widened by it. `lost` [n, k]: orthonormal directions, of parameters in units of `unit`
    [n], that the normal equations lose in rounding; it has no variance there.
    """

    covariance: NDArray[np.float64]
    between: NDArray[np.float64]
    lost: NDArray[np.float64]
    unit: NDArray[np.float64]

    def with_lost(self, white: NDArray[np.float64]) -> NDArray[np.float64]:
        """The covariance, which in what it has lost is that of `white` residuals [n, n], of a Jacobian that tells more than
        its square."""
        within = self.lost.T @ (white / np.outer(self.unit, self.unit)) @ self.lost
        return self.covariance + self.lost @ within @ self.lost.T * np.outer(self.unit, self.unit)


def _unknown(n: int) -> Robust:
    return Robust(np.full((n, n), np.nan), np.ones(n), np.zeros((n, 0)), np.ones(n))


def _between(scores, information, inverse, covariance) -> NDArray[np.float64]:
    """`Robust.between` from every log's score [E, n] and information [E, n, n].

    A log's own step from the common estimate is S⁻¹ times its score. With E logs of shares w of the information the sum
    of the squared steps has about (sum w)² / sum w² - 1 degrees of freedom (Satterthwaite), one taken by the estimate.
    """
    steps = scores @ inverse
    share = np.einsum("ij,ejk,ki->ei", inverse, information, inverse)
    # Shares of parameters far beyond the data may be too large to be squared; their ratio does not hang on their unit.
    share = share / np.maximum(np.abs(share).max(axis=0), np.finfo(float).tiny)
    total = share.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        counts = total**2 / np.sum(share**2, axis=0)
        freedom = np.maximum(counts - 1.0, 0.0)
        ratio = np.sum(steps**2, axis=0) / np.diag(covariance) * counts / freedom
        chance = chi_squared_tail(ratio * freedom, freedom)
    sure = np.isfinite(ratio) & (freedom > _FEW_LOGS) & (chance < _DISAGREE / len(ratio))
    return np.where(sure, np.sqrt(np.maximum(ratio, 1.0)), 1.0)


def robust_covariance(
    structure: Structure, problem: Problem, unknowns: Unknowns, colours: Sequence[Colour] = ()
) -> Robust:
    """Covariance of the physical parameters at the optimum `unknowns`, for coloured residuals, NaN where the sensitivities are
    beyond all numbers; of whitened ones where the channels' `colours` are given. Call under float64."""
    residual, jacobian = (np.asarray(x) for x in sensitivities_at(structure, problem, unknowns))
    mask = np.asarray(problem.mask)
    if colours:
        residual, jacobian = (made_white(colours, own, mask) for own in (residual, jacobian))
    n, s = len(structure.names), len(structure.state_names)
    E, T = residual.shape[:2]
    samples = int(np.any(mask, axis=-1).sum())
    length = int(np.clip(np.ceil(_MEMORIES * memory(residual, mask)), _SHORTEST, max(samples // _FEWEST, _SHORTEST)))
    state_prior = np.asarray(problem.state_precision) * np.asarray(problem.state_scale) ** 2
    information = np.diag(np.asarray(problem.prior_precision))
    by_log = np.zeros((E, n, n))
    scores, own = [], np.zeros((*residual.shape, n))
    for e in range(E):
        J, r = jacobian[e], residual[e]
        H = np.einsum("tyi,tyj->ij", J, J)
        if not np.isfinite(H).all():
            return _unknown(n)
        own_free = np.asarray(problem.state_free[e])
        local = H[n:, n:] + np.diag(np.where(own_free, state_prior, 1.0))
        # A state that the outputs do not show (all its sensitivities are zero) takes up nothing.
        onto = np.linalg.lstsq(local, H[n:, :n], rcond=None)[0].T if s else np.zeros((n, 0))
        by_log[e] = H[:n, :n] - onto @ H[n:, :n]
        information = information + by_log[e]
        own[e] = J[..., :n] - J[..., n:] @ onto.T
        scores.append(np.add.reduceat(np.einsum("tyi,ty->ti", own[e], r), np.arange(0, T, length), axis=0))
    by_blocks_of_log = scores
    u = np.concatenate(scores)
    u = u[np.any(u != 0.0, axis=1)]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = information * np.outer(scale, scale)
    if not np.isfinite(scaled).all():  # a simulation on the brink of diverging: there is no covariance
        return _unknown(n)
    values, vectors = np.linalg.eigh(scaled)
    kept = values > _SINGULAR * values.max()
    inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T * np.outer(scale, scale)
    few = len(u) / max(len(u) - n, 1)  # the residuals have been fitted by n parameters
    by_blocks = inverse @ (u.T @ u) @ inverse * few
    if problem.weight is not None:  # scores are psi(u) J: all of a robust loss's weight belongs to the residual
        weight = np.asarray(problem.weight)
        residual, own = residual * weight, own / weight[..., None]
    by_lags = inverse @ stationary(residual, own, mask, inverse) @ inverse
    one, other = np.diag(by_blocks), np.diag(by_lags)
    if np.all(other > 0.0):
        widen = np.sqrt(np.maximum(one / other, 1.0))
        covariance = by_lags * np.outer(widen, widen)
    else:
        covariance = by_blocks
    used = np.asarray(mask.any(axis=(1, 2)))
    between = _between(np.stack([s.sum(axis=0) for s in by_blocks_of_log])[used], by_log[used], inverse, covariance)
    return Robust(covariance * np.outer(between, between), between, vectors[:, ~kept], scale)
