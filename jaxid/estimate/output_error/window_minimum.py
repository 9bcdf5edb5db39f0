"""The minimum of one window's squares beside what was known before, by Levenberg-Marquardt on its triangle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...kernel.direct import one_triangle
from ...parameters import ParameterError
from .direct import log_triangles
from .laid_out import Direct

Array = NDArray[np.float64]
_STEPS = 40
_SETTLED = 1e-3
"""Drop of half the sum of squares, promised by a linearisation, below which a fit stands: 0.05 standard errors."""
_FIRMER, _LOOSER = 10.0, 0.1
"""Factors of the damping after a step that failed, and after one that did not."""
_FARTHEST = 3.0
"""Multiple of a parameter, or of its magnitude at the start, by which a step may change it."""
SEEN = 1e-7
"""Share of the best seen direction below which one is not seen (columns in units of the parameters)."""


@dataclass(frozen=True)
class Minimum:
    theta: Array
    states: Array
    triangle: Array
    """Of the window's samples alone, its initial states eliminated, [., n + 1]: by the parameters, and what is left."""
    by_channel: Array
    """Sums of squares of the weighted residuals [ny]."""
    converged: bool

    @property
    def squares(self) -> float:
        return float(self.by_channel.sum())


def minimum(d: Direct, theta: Array, states: Array, root: Array, mean: Array) -> Minimum:
    """The minimum near `theta`, `states` of the window's squares and `|root (theta - mean)|²`, by Levenberg-Marquardt."""
    problem, s, n = d.problem, states.shape[1], len(theta)
    size = np.asarray(problem.bounds.scale)
    lower, upper = (np.asarray(x) for x in (problem.bounds.lower, problem.bounds.upper))

    def look(theta: Array, states: Array) -> tuple[Array, Array, float]:
        R, squares = log_triangles(d, theta, size, states)
        off = root @ (theta - mean)
        total = float(np.sum(R[0, :, -1] ** 2) + off @ off)
        return R[0], squares[0], total if np.isfinite(squares).all() else np.inf

    theta = np.clip(theta, lower, upper)
    R, squares, cost = look(theta, states)
    if not np.isfinite(cost):
        raise ParameterError("the simulation of the window diverges at the values to begin with; give others")
    damping, converged = 0.0, False
    for _ in range(_STEPS):
        beside = np.concatenate([np.zeros((len(root), s)), root * size, (root @ (theta - mean))[:, None]], axis=1)
        A = one_triangle(np.concatenate([R, beside]))
        step, promise = _step(A, damping, (lower - theta) / size, (upper - theta) / size, s)
        if promise <= _SETTLED:
            converged = True
            break
        # Where a window says little, a full step may go anywhere.
        far = np.max(np.abs(step[s:]) / np.maximum(np.abs(theta / size), 1.0))
        step *= min(1.0, _FARTHEST / max(far, 1e-300))
        trial = np.clip(theta + size * step[s:], lower, upper), states + step[:s]
        found = look(*trial)
        if found[2] < cost:
            theta, states, (R, squares, cost) = *trial, found
            damping *= _LOOSER
        else:
            damping = max(damping, 1e-4) * _FIRMER
    own = R[s:, s:].copy()
    own[:, :n] /= size
    return Minimum(theta, states, own, squares, converged)


def _step(A: Array, damping: float, low: Array, high: Array, s: int) -> tuple[Array, float]:
    """Damped Gauss-Newton step [s + n] of the triangle A [., s + n + 1], its last n within bounds, and the drop of half the
    squares that it promises. Directions that nothing shows are left alone."""
    J, r = A[:, :-1], A[:, -1]
    norms = np.sqrt((J * J).sum(axis=0))
    units = np.where(norms > 0, norms, 1.0)
    free, step = norms > 0, np.zeros(J.shape[1])
    for _ in range(len(low) + 1):
        U, singular, Vt = np.linalg.svd(J[:, free] / units[free], full_matrices=False)
        kept = singular > SEEN * singular.max(initial=0.0)
        gain = np.where(kept, singular / np.where(kept, singular**2 + damping, 1.0), 0.0)
        step[:] = 0.0
        step[free] = -(Vt.T @ (gain * (U.T @ r))) / units[free]
        out = free.copy()
        out[s:] &= (step[s:] < low) | (step[s:] > high)
        out[:s] = False
        # A parameter that would leave its bounds from on them is held there.
        out[s:] &= ((step[s:] < low) & (low >= 0)) | ((step[s:] > high) & (high <= 0))
        if not out.any():
            break
        free &= ~out
    left = r + J @ step
    return step, 0.5 * float(r @ r - left @ left)
