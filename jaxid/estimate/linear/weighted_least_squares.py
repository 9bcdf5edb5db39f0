r"""Weighted, bounded linear least squares of window equations, by QR, with honest standard errors.

Equations of different units are weighted by their own residual's standard deviation, estimated on the way. Held at the
table's value is only what the equations do not contain at all, or what follows from the other columns; whatever is merely
uncertain is estimated with the others, whose intervals know of it.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jax.typing import ArrayLike
from jaxtyping import Float
from numpy.typing import NDArray
from scipy.linalg import qr as pivoted_qr

from ..._float64 import in_float64
from ...robots.robot import Robot
from ..result import Status
from ..uncertainty import takes_part
from .score_covariance import score_covariance, widened
from .window_equations import WindowEquations

Array = NDArray[np.float64]
_RANK = 1e-7
_NOTHING = 1e-10  # share of the largest effect: rounding
USELESS = 1.0
"""A standard error above this multiple of the parameter: the data says nothing about it."""
_MANY = 100_000  # equations from which their triangles stand for them
_FEW = 3  # degrees of freedom for each parameter, below which scores are no measure of the uncertainty


@in_float64
def solve_by_qr(
    regressors: ArrayLike, targets: ArrayLike
) -> tuple[Float[jax.Array, " n"], Float[jax.Array, "n n"], Float[jax.Array, " K"]]:
    """Least squares `F theta = y` (eq. 31) by QR of column-scaled F [K, n]; runs under `jit` and `vmap`.

    Returns theta [n], its covariance for white noise [n, n] (variance from the residuals), and the residuals
    y - F theta [K]. The normal equations, which square the condition number, are never formed. F needs full rank.
    """
    F, y = jnp.asarray(regressors, float), jnp.asarray(targets, float)
    scale = jnp.linalg.norm(F, axis=0)
    scale = jnp.where(scale > 0, scale, 1.0)
    Q, R = jnp.linalg.qr(F / scale)
    theta = jax.scipy.linalg.solve_triangular(R, Q.T @ y) / scale
    residuals = y - F @ theta
    inverse = jax.scipy.linalg.solve_triangular(R, jnp.eye(F.shape[1])) / scale[:, None]
    variance = residuals @ residuals / max(F.shape[0] - F.shape[1], 1)
    return theta, variance * inverse @ inverse.T, residuals


@dataclass(frozen=True)
class Solution:
    theta: Array  # [n]
    covariance: Array  # [n, n], NaN for what is held
    full: Array  # [n, n], nothing held: infinite variance in directions that the data does not see
    status: tuple[Status, ...]
    noise: Array  # [equations]
    held: NDArray[np.bool_]  # [n], at the table's value: not in the equations, or following from other columns
    unseen: NDArray[np.bool_]  # [n], part of a direction that the equations do not see, the held ones among them

    def errors(self) -> Array:
        """Standard errors [n]; NaN where there is none: in directions that nothing shows, and at bounds."""
        none = self.unseen | np.array([status == "at_bound" for status in self.status], bool)
        return np.where(none, np.nan, np.sqrt(np.diag(self.covariance)))


def _rows(equations: WindowEquations) -> tuple[Array, Array, NDArray[np.int64]]:
    """Regressors, targets and equation of rows that weigh as all `equations` do: these themselves or, of very many, the
    triangle of each speed's, which knows all that weights, scales and bounds ask of them."""
    F, y, kind = equations.regressors, equations.targets, equations.equation
    if len(y) <= _MANY:
        return F, y, kind
    kinds = range(len(equations.speeds))
    parts = [np.linalg.qr(np.column_stack([F[kind == i], y[kind == i]]), mode="r") for i in kinds]
    every = np.concatenate(parts)
    return every[:, :-1], every[:, -1], np.repeat(kinds, [len(part) for part in parts])


def _covariance(
    F: Array, theta: Array, noise: Array, index: NDArray[np.int64], equations: WindowEquations, prior: Array
) -> Array:
    """Covariance [m, m] of the parameters `index` [m]: the sandwich around the scores' scatter, or white residuals for few
    samples. `F`: their columns of weighted rows.

    Within a stretch the noise of the integrals accumulates, and neighbouring stretches share a sample, so residuals are
    correlated.
    """
    m = len(index)
    if m == 0:
        return np.zeros((0, 0))
    scale = np.sqrt(np.sum(F * F, axis=0) + prior)
    R = np.linalg.qr(np.concatenate([F, np.diag(np.sqrt(prior))]) / scale, mode="r")
    inverse = np.linalg.inv(R)
    bread = inverse @ inverse.T
    weight, samples = noise[equations.equation], len(equations.logs)
    residual = (equations.targets - equations.regressors @ theta) / weight
    scores = np.empty((samples, m))
    for own, j, size in zip(scores.T, index, scale, strict=True):
        own[:] = np.bincount(equations.sample, equations.regressors[:, j] / weight / size * residual, samples)
    middle, freedom = score_covariance(scores, equations.logs, equations.memory)
    if freedom < _FEW * m:
        return bread / np.outer(scale, scale)
    middle += np.diag(prior / scale**2)
    return widened(bread @ middle @ bread, freedom) / np.outer(scale, scale)


def _full_covariance(F: Array, prior: Array) -> Array:
    """White-noise covariance with 1e16 (in columns of length one) for what the data does not see: much, but with rounding
    of 1e-16 of it still nothing to combinations that have no part in it."""
    scale = np.linalg.norm(F, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    rows = np.concatenate([F, np.diag(np.sqrt(prior))]) / scale
    _, singular, Vt = np.linalg.svd(np.linalg.qr(rows, mode="r"))
    inverse = np.where(singular > _RANK * singular.max(initial=1e-300), 1.0 / np.maximum(singular, 1e-150) ** 2, 1e16)
    return (Vt.T * inverse) @ Vt / np.outer(scale, scale)


def unseen_of(F: Array, prior: Array, size: Array) -> NDArray[np.bool_]:
    """[n]: parameters of magnitudes `size` [n] that take part in a direction which the columns F [K, n] do not see."""
    scale = np.sqrt(np.sum(F * F, axis=0) + prior)
    stacked = np.concatenate([F, np.diag(np.sqrt(prior))]) / np.where(scale > 0, scale, 1.0)
    _, singular, Vt = np.linalg.svd(np.linalg.qr(stacked, mode="r"))
    blind = Vt[singular <= _RANK * singular.max(initial=1e-300)]
    return takes_part(blind, scale, size) | (scale == 0)


def statuses(
    theta: Array, errors: Array, size: Array, unseen: NDArray[np.bool_], bound: NDArray[np.bool_]
) -> tuple[Status, ...]:
    """What may be said of estimates with these joint standard `errors` [n], beside what they must stay below (`size`)."""
    useless = unseen | ~(errors <= USELESS * size)
    return tuple(
        "not_identifiable" if u else "at_bound" if b else "identified" for u, b in zip(useless, bound, strict=True)
    )


def known_size(theta: Array, default: Array, F: Array, y: Array) -> Array:
    """What a standard error [n] must stay below to say anything: the estimate or the table's value, whichever is larger.

    A table's value that would explain more than all there is comes from other units and is cut down to that. A value of
    zero is no measure of anything.
    """
    lengths = np.linalg.norm(F, axis=0)
    most = np.linalg.norm(y) / np.where(lengths > 0, lengths, np.inf)
    size = np.maximum(np.abs(theta), np.minimum(np.abs(default), most))
    return np.where(default != 0, size, np.inf)


def _within(R: Array, rhs: Array, lower: Array, upper: Array) -> tuple[Array, NDArray[np.bool_]]:
    """The least-squares solution of R x = rhs within bounds, and which of them stop it."""
    x: Array = np.asarray(np.linalg.lstsq(R, rhs, rcond=-1)[0], dtype=np.float64)
    if np.all((x >= lower) & (x <= upper)):
        return x, np.zeros(len(x), bool)
    # SciPy's optimisers take a sixth of a second to import, and few fits meet a bound.
    solved = scipy.optimize.lsq_linear(R, rhs, bounds=(lower, upper), method="bvls", tol=1e-14)
    return solved.x, solved.active_mask != 0


def solve(equations: WindowEquations, robot: Robot, held: NDArray[np.bool_]) -> Solution:
    """Weigh, bound and solve; parameters that the equations do not contain, or not beside the others, stay at the table.

    The covariance is that of all others together, also of those that a bound stops: with one of them taken as known, the
    intervals of its neighbours would be too short.
    """
    table = [robot.parameters[name] for name in equations.names]
    default = np.array([p.value for p in table])
    lower, upper = np.array([p.lower for p in table]), np.array([p.upper for p in table])
    mean = np.array([p.prior[0] if p.prior else 0.0 for p in table])
    prior = np.array([p.prior[1] ** -2.0 if p.prior else 0.0 for p in table])
    magnitude = np.array([abs(p.value) or p.typical or 0.0 for p in table])
    n, kinds = len(table), len(equations.speeds)
    which = [equations.equation == i for i in range(kinds)]
    counts = np.array([np.sum(own) for own in which], dtype=float)
    stretches = np.array([len(np.unique(equations.stretch[own])) for own in which])
    # Start with weights that put the equations on a common scale, whatever their units: that of their terms. At good values of
    # the table the terms of an equation without a target cancel: weighed by their sum, it would be solved by nothing at all.
    terms = np.column_stack([equations.targets, equations.regressors * default])
    size = [float(np.sqrt(np.max(np.mean(terms[own] ** 2, axis=0)))) if own.any() else 0.0 for own in which]
    F, y, kind = _rows(equations)
    noise = np.array([s if s > 0 else 1.0 for s in size])
    held, theta = held.copy(), default.copy()
    bound = np.zeros(n, bool)
    covariance, full = np.full((n, n), np.nan), np.full((n, n), np.inf)
    weighted, target = F, y
    for _ in range(3 * n + 6):
        weighted, target = F / noise[kind, None], y / noise[kind]
        lengths = np.sqrt(np.sum(weighted**2, axis=0) + prior)
        held |= lengths == 0
        # The columns that say most at the table's values come first; those that follow from them, or say nothing beside
        # them, are held.
        typical = np.where(magnitude > 0, magnitude, 1.0 / np.where(lengths > 0, lengths, 1.0))
        held |= typical * lengths < _NOTHING * np.max(typical * lengths)
        index = np.flatnonzero(~held)
        if not len(index):
            break
        stacked = np.concatenate([weighted, np.diag(np.sqrt(prior))])[:, index]
        order = np.asarray(pivoted_qr(stacked * typical[index], mode="r", pivoting=True)[-1], dtype=int)
        unit = stacked[:, order] / lengths[index[order]]
        diagonal = np.abs(np.diag(np.linalg.qr(unit, mode="r")))
        follows = index[order[: len(diagonal)][diagonal < _RANK]]
        if len(follows):
            held[follows] = True
            continue
        rhs = np.append(target - weighted[:, held] @ default[held], np.sqrt(prior) * mean)
        scale = lengths[index]
        Q, R = np.linalg.qr(stacked / scale)
        theta, bound = default.copy(), np.zeros(n, bool)
        found, bound[index] = _within(R, Q.T @ rhs, lower[index] * scale, upper[index] * scale)
        theta[index] = np.clip(found / scale, lower[index], upper[index])
        residuals = y - F @ theta
        squares = np.array([np.sum(residuals[kind == i] ** 2) for i in range(kinds)])
        freedom = np.maximum(counts - stretches - np.sum(~held) * counts / max(counts.sum(), 1.0), 1.0)
        before, noise = noise, np.sqrt(squares / freedom)
        # An exact fit leaves rounding; its weights mean nothing but must not be infinite.
        noise = np.maximum(noise, 1e-13 * np.array([max(s, 1e-300) for s in size]))
        if np.max(np.abs(noise / before - 1.0)) > 0.02 and np.max(noise / np.maximum(size, 1e-300)) > 1e-9:
            continue
        weighted, target = F / noise[kind, None], y / noise[kind]
        own = _covariance(weighted[:, index], theta, noise, index, equations, prior[index])
        covariance[np.ix_(index, index)] = own
        full = _full_covariance(weighted, prior)
        break
    errors, size = np.sqrt(np.diag(covariance)), known_size(theta, default, weighted, target)
    unseen = held | unseen_of(weighted, prior, size)
    return Solution(theta, covariance, full, statuses(theta, errors, size, unseen, bound), noise, held, unseen)
