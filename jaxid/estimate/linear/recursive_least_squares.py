r"""Recursive (on-line) least squares in square-root form, by QR.

What is carried along is the triangle of the equations seen so far, `R theta = z`, never its square. New equations are
stacked beneath it and rotated away, so the estimate after the last one is that of all equations at once (eq. 31), to
rounding. `theta` may be asked for at any time.

Numbers go through LAPACK at once, tens of microseconds an equation; what JAX traces (`jit`, `vmap`, `scan`) takes its own
decomposition. Both give the same to rounding.
"""

from functools import cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jax.core import Tracer
from jax.typing import ArrayLike
from jaxtyping import Float

from ..._float64 import in_float64
from ...robots.robot import Robot

Array = Any
"""NumPy's, or JAX's where JAX traced."""
_DETERMINED = 1e-10
"""Share of its column that a diagonal element of the triangle must be."""


class RecursiveLeastSquares(eqx.Module):
    """Square-root information about n parameters.

    `R` [n, n] upper triangular and `z` [n] with `R theta = z`; `rest` the root of the residuals' sum of squares and
    `count` the number of equations, both discounted by forgetting. Equations are taken to have noise of one standard
    deviation: weight rows of different units first. Arrays are NumPy's, or JAX's where JAX traced.
    """

    R: Float[Array, "n n"]
    z: Float[Array, " n"]
    rest: Float[Array, ""]
    count: Float[Array, ""]

    @staticmethod
    def start(n: int, mean: ArrayLike | None = None, std: ArrayLike | None = None) -> "RecursiveLeastSquares":
        """No information about `n` parameters, or a Gaussian prior `mean` [n], `std` [n] (in units of the noise)."""
        nothing = np.zeros(())
        if mean is None or std is None:
            return RecursiveLeastSquares(np.zeros((n, n)), np.zeros(n), nothing, nothing)
        if _traced(mean, std):
            return _prior_in_jax(n, mean, std)
        root = 1.0 / np.broadcast_to(np.asarray(std, float), (n,))
        return RecursiveLeastSquares(np.diag(root), root * np.asarray(mean, float), nothing, nothing)

    def update(self, regressors: ArrayLike, targets: ArrayLike, forgetting: ArrayLike = 1.0) -> "RecursiveLeastSquares":
        """The state after further equations `regressors` [m, n] @ theta = `targets` [m].

        `forgetting` in (0, 1] discounts everything before them; 1 forgets nothing. Runs under `jit`, `vmap`, `scan`.
        """
        if _traced(regressors, targets, forgetting, self.R, self.z, self.rest, self.count):
            return _updated_in_jax(self, regressors, targets, forgetting)
        F, y = np.atleast_2d(np.asarray(regressors, float)), np.atleast_1d(np.asarray(targets, float))
        return RecursiveLeastSquares(*_updated(*_numbers(self), F, y, float(np.asarray(forgetting))))

    @property
    def theta(self) -> Float[Array, " n"]:
        """The estimate [n]; NaN while the equations do not determine it."""
        if _traced(self.R, self.z):
            return _theta_in_jax(self)
        return _theta(np.asarray(self.R, float), np.asarray(self.z, float))

    @property
    def covariance(self) -> Float[Array, "n n"]:
        """Covariance [n, n] of `theta` for white noise, its variance estimated from the residuals so far."""
        if _traced(self.R, self.z, self.rest, self.count):
            return _covariance_in_jax(self)
        root = _inverse(*_numbers(self))
        return root @ root.T


def _traced(*values: Any) -> bool:
    """Whether JAX is tracing any of the values, or what is in a list of them."""
    return any(isinstance(value, Tracer) or (isinstance(value, list | tuple) and _traced(*value)) for value in values)


# -- numbers ------------------------------------------------------------------------------------------------------------
def _numbers(state: RecursiveLeastSquares) -> tuple[np.ndarray, np.ndarray, np.float64, np.float64]:
    return np.asarray(state.R, float), np.asarray(state.z, float), np.float64(state.rest), np.float64(state.count)


def _updated(
    R: np.ndarray, z: np.ndarray, rest: float, count: float, F: Array, y: Array, forgetting: float
) -> tuple[np.ndarray, np.ndarray, np.float64, np.float64]:
    (m, n), kept = F.shape, forgetting**0.5
    stacked = np.empty((n + 1 + m, n + 1), order="F")
    stacked[:n, :n], stacked[:n, n] = R, z
    stacked[n, :n], stacked[n, n] = 0.0, rest
    stacked[: n + 1] *= kept
    stacked[n + 1 :, :n], stacked[n + 1 :, n] = F, y
    # Rows of zeros (padding) count as no equation.
    new = int(np.count_nonzero(stacked[n + 1 :].any(axis=1)))
    below = scipy.linalg.lapack.dgeqrf(stacked, overwrite_a=True)[0]
    triangle = np.where(_upper(n + 1), below[: n + 1], 0.0)
    return triangle[:n, :n], triangle[:n, n], np.float64(abs(triangle[n, n])), np.float64(count * forgetting + new)


@cache
def _upper(n: int) -> np.ndarray:
    return np.triu(np.ones((n, n), bool))


def _theta(R: np.ndarray, z: np.ndarray) -> np.ndarray:
    size = np.sqrt((R * R).sum(axis=0))
    # A column of nothing is not determined either, nor is anything that is not finite.
    if not (np.abs(R.diagonal()) > _DETERMINED * size).all():
        return np.full(len(z), np.nan)
    return scipy.linalg.lapack.dtrtrs(R, z)[0]


def _inverse(R: np.ndarray, z: np.ndarray, rest: float, count: float) -> np.ndarray:
    """A root [n, n] of the covariance; NaN while the equations do not determine the estimate."""
    if not np.isfinite(_theta(R, z)).all():
        return np.full(R.shape, np.nan)
    return rest / max(count - len(z), 1.0) ** 0.5 * scipy.linalg.lapack.dtrtri(R)[0]


# -- what JAX traces ----------------------------------------------------------------------------------------------------
@in_float64
def _prior_in_jax(n: int, mean: ArrayLike, std: ArrayLike) -> RecursiveLeastSquares:
    root = 1.0 / jnp.broadcast_to(jnp.asarray(std, float), (n,))
    return RecursiveLeastSquares(jnp.diag(root), root * jnp.asarray(mean, float), jnp.zeros(()), jnp.zeros(()))


@in_float64
def _updated_in_jax(
    state: RecursiveLeastSquares, regressors: ArrayLike, targets: ArrayLike, forgetting: ArrayLike
) -> RecursiveLeastSquares:
    F = jnp.atleast_2d(jnp.asarray(regressors, float))
    y = jnp.atleast_1d(jnp.asarray(targets, float))
    n, forgotten = F.shape[1], jnp.asarray(forgetting, float)
    kept = jnp.sqrt(forgotten)
    known = jnp.concatenate([state.R, jnp.asarray(state.z)[:, None]], axis=1) * kept
    last = jnp.concatenate([jnp.zeros(n), (jnp.asarray(state.rest) * kept)[None]])[None]
    new = jnp.concatenate([F, y[:, None]], axis=1)
    triangle = jnp.linalg.qr(jnp.concatenate([known, last, new]), mode="r")
    count = state.count * forgotten + jnp.sum(jnp.any(new != 0, axis=1))
    return RecursiveLeastSquares(triangle[:n, :n], triangle[:n, n], jnp.abs(triangle[n, n]), count)


@in_float64
def _theta_in_jax(state: RecursiveLeastSquares) -> Any:
    diagonal = jnp.abs(jnp.diagonal(state.R))
    column = jnp.linalg.norm(state.R, axis=0)
    determined = jnp.all(diagonal > _DETERMINED * column) & jnp.all(column > 0)
    safe = jnp.where(determined, state.R, jnp.eye(len(state.z)))
    theta = jax.scipy.linalg.solve_triangular(safe, state.z)
    return jnp.where(determined, theta, jnp.nan)


@in_float64
def _covariance_in_jax(state: RecursiveLeastSquares) -> Any:
    n = len(state.z)
    inverse = jax.scipy.linalg.solve_triangular(state.R, jnp.eye(n))
    variance = state.rest**2 / jnp.maximum(state.count - n, 1.0)
    return jnp.where(jnp.isfinite(_theta_in_jax(state))[:, None], variance * inverse @ inverse.T, jnp.nan)


@in_float64
def _scan(start: RecursiveLeastSquares, regressors: Any, targets: Any, forgetting: float) -> Any:
    def step(state: RecursiveLeastSquares, block: Any):
        state = _updated_in_jax(state, block[0], block[1], forgetting)
        return state, (_theta_in_jax(state), jnp.sqrt(jnp.diagonal(_covariance_in_jax(state))))

    begin = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), start)
    state, (theta, errors) = jax.lax.scan(step, begin, (regressors, targets))
    return state, theta, errors


# -- records ------------------------------------------------------------------------------------------------------------
def recursive_least_squares(
    regressors: ArrayLike, targets: ArrayLike, forgetting: float = 1.0, start: RecursiveLeastSquares | None = None
) -> tuple[RecursiveLeastSquares, Float[Array, "B n"], Float[Array, "B n"]]:
    """Run through B blocks of equations: `regressors` [B, m, n] (or [B, n], one equation a block), `targets` [B, m].

    Blocks of unequal length are padded with rows of zeros, which say nothing. Returns the last state and the history
    of estimates and standard errors [B, n], NaN until there are enough equations. Those of a robot's logs are from
    `jaxid.estimate.linear.window_equations.window_equations(robot, logs).as_they_came()`. Raises `ValueError` for shapes that
    do not fit and for a forgetting factor outside (0, 1], `TypeError` for a robot in the place of equations.
    """
    if isinstance(regressors, Robot):
        raise TypeError(
            "a robot is no equations; give the regressors and targets of "
            "jaxid.estimate.linear.window_equations.window_equations(robot, logs).as_they_came()"
        )
    traced = _traced(regressors, targets, *jax.tree.leaves(start))
    F, y = (jnp.asarray(x) if traced else np.asarray(x, float) for x in (regressors, targets))
    if F.ndim == 2 and y.ndim == 1:
        F, y = F[:, None], y[:, None]
    if F.ndim != 3 or y.shape != F.shape[:2]:
        raise ValueError(
            f"Regressors of shape {F.shape} and targets of shape {y.shape} do not fit; give [B, m, n], [B, m]."
        )
    if not 0 < forgetting <= 1:
        raise ValueError(f"A forgetting factor of {forgetting} is not in (0, 1]; use 1 to forget nothing.")
    begin = RecursiveLeastSquares.start(F.shape[-1]) if start is None else start
    if traced:
        return _scan(begin, F, y, forgetting)
    state = _numbers(begin)
    theta, errors = np.empty((len(F), F.shape[-1])), np.empty((len(F), F.shape[-1]))
    for k in range(len(F)):
        state = _updated(*state, F[k], y[k], forgetting)
        theta[k] = _theta(*state[:2])
        root = _inverse(*state)
        errors[k] = np.sqrt(np.einsum("ij,ij->i", root, root))
    return RecursiveLeastSquares(*state), theta, errors
