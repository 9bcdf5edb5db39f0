r"""Recursive (on-line) least squares in square-root form, by QR.

What is carried along is the triangle of the equations seen so far, `R theta = z`, never its square. New equations are
stacked beneath it and rotated away, so the estimate after the last one is that of all equations at once (eq. 31), to
rounding. `theta` may be asked for at any time.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from ..._float64 import in_float64


class RecursiveLeastSquares(eqx.Module):
    """Square-root information about n parameters.

    `R` [n, n] upper triangular and `z` [n] with `R theta = z`; `rest` the root of the residuals' sum of squares and
    `count` the number of equations, both discounted by forgetting. Equations are taken to have noise of one standard
    deviation: weight rows of different units first.
    """

    R: Float[Array, "n n"]
    z: Float[Array, " n"]
    rest: Float[Array, ""]
    count: Float[Array, ""]

    @staticmethod
    @in_float64
    def start(n: int, mean: ArrayLike | None = None, std: ArrayLike | None = None) -> "RecursiveLeastSquares":
        """No information about `n` parameters, or a Gaussian prior `mean` [n], `std` [n] (in units of the noise)."""
        if mean is None or std is None:
            return RecursiveLeastSquares(jnp.zeros((n, n)), jnp.zeros(n), jnp.zeros(()), jnp.zeros(()))
        root = 1.0 / jnp.broadcast_to(jnp.asarray(std, float), (n,))
        return RecursiveLeastSquares(jnp.diag(root), root * jnp.asarray(mean, float), jnp.zeros(()), jnp.zeros(()))

    @in_float64
    def update(
        self, regressors: ArrayLike, targets: ArrayLike, forgetting: float | Float[Array, ""] = 1.0
    ) -> "RecursiveLeastSquares":
        """The state after further equations `regressors` [m, n] @ theta = `targets` [m].

        `forgetting` in (0, 1] discounts everything before them; 1 forgets nothing. Runs under `jit`, `vmap`, `scan`.
        """
        F = jnp.atleast_2d(jnp.asarray(regressors, float))
        y = jnp.atleast_1d(jnp.asarray(targets, float))
        n, kept = F.shape[1], jnp.sqrt(jnp.asarray(forgetting, float))
        known = jnp.concatenate([self.R, self.z[:, None]], axis=1) * kept
        last = jnp.concatenate([jnp.zeros(n), (self.rest * kept)[None]])[None]
        stacked = jnp.concatenate([known, last, jnp.concatenate([F, y[:, None]], axis=1)])
        triangle = jnp.linalg.qr(stacked, mode="r")
        # Rows of zeros (padding) count as no equation.
        new = jnp.sum(jnp.any(jnp.concatenate([F, y[:, None]], axis=1) != 0, axis=1))
        count = self.count * jnp.asarray(forgetting, float) + new
        return RecursiveLeastSquares(triangle[:n, :n], triangle[:n, n], jnp.abs(triangle[n, n]), count)

    @property
    @in_float64
    def theta(self) -> Float[Array, " n"]:
        """The estimate [n]; NaN while the equations do not determine it."""
        diagonal = jnp.abs(jnp.diagonal(self.R))
        column = jnp.linalg.norm(self.R, axis=0)
        determined = jnp.all(diagonal > 1e-10 * column) & jnp.all(column > 0)
        safe = jnp.where(determined, self.R, jnp.eye(len(self.z)))
        theta = jax.scipy.linalg.solve_triangular(safe, self.z)
        return jnp.where(determined, theta, jnp.nan)

    @property
    @in_float64
    def covariance(self) -> Float[Array, "n n"]:
        """Covariance [n, n] of `theta` for white noise, its variance estimated from the residuals so far."""
        n = len(self.z)
        inverse = jax.scipy.linalg.solve_triangular(self.R, jnp.eye(n))
        variance = self.rest**2 / jnp.maximum(self.count - n, 1.0)
        return jnp.where(jnp.isfinite(self.theta)[:, None], variance * inverse @ inverse.T, jnp.nan)


@jax.jit
def _scan(start: RecursiveLeastSquares, regressors, targets, forgetting):
    def step(state: RecursiveLeastSquares, block):
        state = state.update(block[0], block[1], forgetting)
        return state, (state.theta, jnp.sqrt(jnp.diagonal(state.covariance)))

    return jax.lax.scan(step, start, (regressors, targets))


@in_float64
def recursive_least_squares(
    regressors: ArrayLike, targets: ArrayLike, forgetting: float = 1.0, start: RecursiveLeastSquares | None = None
) -> tuple[RecursiveLeastSquares, Float[Array, "B n"], Float[Array, "B n"]]:
    """Run through B blocks of equations: `regressors` [B, m, n] (or [B, n], one equation a block), `targets` [B, m].

    Blocks of unequal length are padded with rows of zeros, which say nothing. Returns the last state and the history
    of estimates and standard errors [B, n], NaN until there are enough equations. Raises `ValueError` for shapes that
    do not fit and for a forgetting factor outside (0, 1].
    """
    F, y = jnp.asarray(regressors, float), jnp.asarray(targets, float)
    if F.ndim == 2 and y.ndim == 1:
        F, y = F[:, None], y[:, None]
    if F.ndim != 3 or y.shape != F.shape[:2]:
        raise ValueError(
            f"Regressors of shape {F.shape} and targets of shape {y.shape} do not fit; give [B, m, n], [B, m]."
        )
    if not 0 < forgetting <= 1:
        raise ValueError(f"A forgetting factor of {forgetting} is not in (0, 1]; use 1 to forget nothing.")
    start = RecursiveLeastSquares.start(F.shape[-1]) if start is None else start
    state, (theta, errors) = _scan(start, F, y, jnp.asarray(forgetting, float))
    return state, theta, errors
