"""Gaussian moments carried through nonlinear steps at cubature points, and corrected by measurements.

Cubature points (Arasaratnam & Haykin, Cubature Kalman filters, IEEE Trans. Automatic Control 54, 2009) instead of
derivatives: a model that sticks has a derivative of zero with respect to its speed, so that an extended filter stays blind
when the real robot moves and the model does not, and its likelihood jumps where a point crosses from sticking to sliding.
The points spread as far as the state is uncertain and reach beyond. All matrices are small, so they are written out in
scalar operations, which compile into one loop over all lanes.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


class Moments(NamedTuple):
    """Mean and covariance of the state."""

    mean: Float[Array, " n"]
    covariance: Float[Array, "n n"]


class Innovations(NamedTuple):
    """What one sample's outputs say beyond what was expected, one after the other; both 0 and 1 where not measured."""

    surprise: Float[Array, " ny"]
    variance: Float[Array, " ny"]


def root(covariance: Float[Array, "n n"], floor: Float[Array, " n"]) -> Float[Array, "n n"]:
    """Lower triangular L with L Lᵀ = covariance (Cholesky), no pivot below the variance `floor`.

    The floor lets covariances be singular (a state that is known, a robot that sticks), with finite derivatives.
    """
    n = covariance.shape[0]
    rows: list[list[Array]] = [[] for _ in range(n)]
    for j in range(n):
        left = covariance[j, j] - sum((x * x for x in rows[j]), jnp.zeros(()))
        pivot = jnp.sqrt(jnp.maximum(left, floor[j]))
        for i in range(j + 1, n):
            crossed = sum((a * b for a, b in zip(rows[i], rows[j], strict=True)), jnp.zeros(()))
            rows[i] = [*rows[i], (covariance[i, j] - crossed) / pivot]
        rows[j] = [*rows[j], pivot]
    zero = jnp.zeros(())
    return jnp.stack([jnp.stack([*row, *[zero] * (n - len(row))]) for row in rows])


def points(moments: Moments, floor: Float[Array, " n"]) -> Float[Array, "2*n n"]:
    """The cubature points, all of the same weight."""
    n = moments.mean.shape[0]
    spread = jnp.sqrt(float(n)) * root(moments.covariance, floor).T
    return jnp.concatenate([moments.mean + spread, moments.mean - spread])


def moments_of(cloud: Float[Array, "m n"]) -> Moments:
    """Mean and covariance of points of equal weight."""
    mean = jnp.mean(cloud, axis=0)
    return Moments(mean, crossed(cloud - mean, cloud - mean))


def crossed(one: Float[Array, "m n"], other: Float[Array, "m k"]) -> Float[Array, "n k"]:
    """Cross-covariance of deviations of points of equal weight."""
    return jnp.mean(one[:, :, None] * other[:, None, :], axis=0)


def carried(
    moments: Moments, advance: Callable[[Float[Array, " n"]], Float[Array, " n"]], floor: Float[Array, " n"]
) -> tuple[Moments, Float[Array, "n n"]]:
    """Moments after `advance`, and the cross-covariance of the state before with the state after."""
    before = points(moments, floor)
    ahead = jax.vmap(advance)(before)
    after = moments_of(ahead)
    return after, crossed(before - moments.mean, ahead - after.mean)


def measured(
    moments: Moments,
    expected: Float[Array, " ny"],
    slope: Float[Array, "ny n"],
    y: Float[Array, " ny"],
    there: Bool[Array, " ny"],
    noise: Float[Array, " ny"],
) -> tuple[Moments, Innovations]:
    """Moments after one sample's outputs `y`, whose independent noises have the standard deviations `noise`.

    One output after the other, so that nothing is inverted; in Joseph's form, which keeps the covariance positive
    whatever is rounded. `expected` and `slope` are the outputs and their derivative at the mean.
    """
    first, mean, covariance = moments.mean, moments.mean, moments.covariance
    surprises, variances = [], []
    for i in range(y.shape[0]):
        c = slope[i]
        surprise = y[i] - expected[i] - jnp.sum(c * (mean - first))
        along = jnp.sum(covariance * c, axis=1)
        variance = jnp.sum(c * along) + noise[i] ** 2
        gain = jnp.where(there[i], along / variance, 0.0)
        mean = mean + gain * surprise
        kept = covariance - gain[:, None] * along[None, :]  # (I - k c) P
        kept = kept - jnp.sum(kept * c, axis=1)[:, None] * gain[None, :]
        covariance = kept + gain[:, None] * gain[None, :] * noise[i] ** 2
        surprises.append(jnp.where(there[i], surprise, 0.0))
        variances.append(jnp.where(there[i], variance, 1.0))
    return Moments(mean, covariance), Innovations(jnp.stack(surprises), jnp.stack(variances))
