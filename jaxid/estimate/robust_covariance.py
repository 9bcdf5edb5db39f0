"""Covariance that stays right when neighbouring residuals are correlated.

(JᵀJ)⁻¹ holds for white residuals. Filtered sensors and whatever the model lacks make them coloured, and then it is too
small. The sandwich S⁻¹ (sum over blocks of u uᵀ) S⁻¹ sums the scores u of blocks of time that are longer than the residual
remembers, and needs no model of the colour (Newey & West, Econometrica 55, 1987; blocks as in Liang & Zeger, Biometrika 73,
1986).
"""

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray

from .._compile import compiled
from .problem import Problem, Structure, Unknowns, sensitivities

_MEMORIES = 10.0
"""Block length in units of the residual's correlation time: what correlates across borders is then a tenth."""
_SHORTEST, _FEWEST = 10, 30
"""Samples of the shortest block, and blocks that there must be at least."""
_REMEMBERED = 0.05
"""Correlation below which the residual has forgotten."""
_SINGULAR = 1e-13

_sensitivities = compiled(sensitivities, static_argnums=0)


def memory(residual: Float[NDArray, "E T ny"], mask: Bool[NDArray, "E T ny"]) -> float:
    """Correlation time of the slowest channel [samples]: one for white residuals."""
    longest = 1.0
    for y in range(residual.shape[-1]):
        r = np.where(mask[..., y], residual[..., y], 0.0)
        power = float(np.sum(r * r))
        if power == 0.0:
            continue
        total = 1.0
        for lag in range(1, r.shape[1] // 4):
            rho = float(np.sum(r[:, lag:] * r[:, :-lag])) / power
            if rho < _REMEMBERED:
                break
            total += 2.0 * rho
        longest = max(longest, total)
    return longest


def robust_covariance(structure: Structure, problem: Problem, unknowns: Unknowns) -> NDArray[np.float64]:
    """Covariance [n, n] of the physical parameters at the optimum `unknowns`, for coloured residuals. Call under float64."""
    residual, jacobian = (np.asarray(x) for x in _sensitivities(structure, problem, unknowns))
    mask = np.asarray(problem.mask)
    n, s = len(structure.names), len(structure.state_names)
    E, T = residual.shape[:2]
    samples = int(np.any(mask, axis=-1).sum())
    length = int(np.clip(np.ceil(_MEMORIES * memory(residual, mask)), _SHORTEST, max(samples // _FEWEST, _SHORTEST)))
    state_prior = np.asarray(problem.state_precision) * np.asarray(problem.state_scale) ** 2
    information = np.diag(np.asarray(problem.prior_precision))
    scores = []
    for e in range(E):
        J, r = jacobian[e], residual[e]
        H = np.einsum("tyi,tyj->ij", J, J)
        own_free = np.asarray(problem.state_free[e])
        local = H[n:, n:] + np.diag(np.where(own_free, state_prior, 1.0))
        onto = np.linalg.solve(local, H[n:, :n]).T if s else np.zeros((n, 0))
        information = information + H[:n, :n] - onto @ H[n:, :n]
        per_sample = np.einsum("tyi,ty->ti", J, r)
        blocks = np.add.reduceat(per_sample, np.arange(0, T, length), axis=0)
        scores.append(blocks[:, :n] - blocks[:, n:] @ onto.T)
    u = np.concatenate(scores)
    u = u[np.any(u != 0.0, axis=1)]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    kept = values > _SINGULAR * values.max()
    inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T * np.outer(scale, scale)
    few = len(u) / max(len(u) - n, 1)  # the residuals have been fitted by n parameters
    return inverse @ (u.T @ u) @ inverse * few
