r"""Likelihood of logs under a model with process and sensor noise, its gradient and Fisher information.

The innovations e_k of the right model are independent and Gaussian with the variances S_k that the filter states, so

    -log L = 1/2 sum over experiments, samples, channels of  e²/S + log S + log 2 pi     (+ priors)

(Schweppe 1965; Ljung, System Identification, 1999, section 7.4; Kristensen et al. 2004, eq. 12). Its expected second
derivative needs first derivatives of e and S alone, which forward mode gives for all unknowns as lanes:

    I = sum of  de deᵀ / S + 1/2 dS dSᵀ / S².
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .filter import Model, Record, filtered

_DIVERGED = 1e30
"""Stands in for a likelihood that is no number: larger than any sound one, so that the step is rejected."""


class Unknowns(NamedTuple):
    """The optimiser's coordinates: `z` of the parameters in units of their scale, logarithms of the noises in units of
    their references."""

    z: Float[Array, " n"]
    process: Float[Array, " nv"]
    sensor: Float[Array, " ny"]


class Problem(eqx.Module):
    """The numbers of a prediction-error problem: E experiments, n parameters, nv noisy velocities, ny channels.

    Parameters stay within `lower` and `upper` by projection; `scale` is a mere unit. What is not free is data, not
    structure: parameters stay at `held`, intensities of process noise at zero (where
    `disturbed` is False), sensor noise at `sensor_reference` (where `sensed` is False).
    """

    records: Record
    numbers: dict[str, Float[Array, ""]]
    lower: Float[Array, " n"]
    upper: Float[Array, " n"]
    scale: Float[Array, " n"]
    free: Bool[Array, " n"]
    held: Float[Array, " n"]
    prior_mean: Float[Array, " n"]
    prior_precision: Float[Array, " n"]
    process_reference: Float[Array, " nv"]
    disturbed: Bool[Array, " nv"]
    sensor_reference: Float[Array, " ny"]
    sensed: Bool[Array, " ny"]


class Look(NamedTuple):
    """-log L at a point, its gradient and the Fisher information, in the optimiser's coordinates [p = n + nv + ny]."""

    cost: Float[Array, ""]
    gradient: Float[Array, " p"]
    information: Float[Array, "p p"]


def parameters_at(problem: Problem, z: Float[Array, " n"]) -> Float[Array, " n"]:
    """Physical parameters, those not free at their held values."""
    return jnp.where(problem.free, problem.scale * z, problem.held)


def intensities_at(problem: Problem, process: Float[Array, " nv"]) -> Float[Array, " nv"]:
    """Intensities of the process noise, zero where there is none."""
    return jnp.where(problem.disturbed, problem.process_reference * jnp.exp(process), 0.0)


def noise_at(problem: Problem, sensor: Float[Array, " ny"]) -> Float[Array, " ny"]:
    """Standard deviation of the sensor noise of every channel."""
    return problem.sensor_reference * jnp.exp(jnp.where(problem.sensed, sensor, 0.0))


def flat(unknowns: Unknowns) -> Float[Array, " p"]:
    """All coordinates in a row."""
    return jnp.concatenate(unknowns)


def unflat(problem: Problem, x: Float[Array, " p"]) -> Unknowns:
    """The coordinates by kind."""
    n, nv = problem.held.shape[0], problem.process_reference.shape[0]
    return Unknowns(x[:n], x[n : n + nv], x[n + nv :])


def _columns(problem: Problem) -> Float[Array, " p"]:
    """One for coordinates that are free, zero for the others."""
    return jnp.concatenate([problem.free, problem.disturbed, problem.sensed]).astype(float)


def _pull(problem: Problem, z):
    """Half chi-squared of the priors."""
    off = parameters_at(problem, z) - problem.prior_mean
    return 0.5 * jnp.sum(jnp.where(problem.free, problem.prior_precision, 0.0) * off**2)


def innovations(names: tuple[str, ...], model: Model, problem: Problem, x: Float[Array, " p"], record: Record):
    """Whitened innovations e / sqrt(S) and log S [T, ny] of one experiment; zero where nothing was measured."""
    at = unflat(problem, x)
    p = {**problem.numbers, **dict(zip(names, parameters_at(problem, at.z), strict=True))}
    news, _, _ = filtered(model, p, record, intensities_at(problem, at.process), noise_at(problem, at.sensor))
    return news.surprise / jnp.sqrt(news.variance), jnp.log(news.variance)


def _half_log_two_pi(problem: Problem):
    return 0.5 * jnp.log(2 * jnp.pi) * jnp.sum(problem.records.there)


def cost(names: tuple[str, ...], model: Model, problem: Problem, x: Float[Array, " p"]) -> Float[Array, ""]:
    """-log L, priors included, from the filter alone."""

    def one(record):
        white, level = innovations(names, model, problem, x, record)
        return 0.5 * jnp.sum(white**2 + level)

    total = jnp.sum(jax.vmap(one)(problem.records)) + _half_log_two_pi(problem) + _pull(problem, x[: len(names)])
    return jnp.where(jnp.isfinite(total), total, _DIVERGED)


def sensitivities(names: tuple[str, ...], model: Model, problem: Problem, x: Float[Array, " p"], record: Record):
    """Of one experiment: whitened innovations [T, ny], log S [T, ny], and both their derivatives [T, ny, p]."""

    def own(x):
        return innovations(names, model, problem, x, record)

    # One program for primal and tangents: the primal is not repeated for every direction.
    (white, level), (d_white, d_level) = jax.vmap(lambda t: jax.jvp(own, (x,), (t,)), out_axes=(None, -1))(
        jnp.diag(_columns(problem))
    )
    return white, level, d_white, d_level


def scores(white, level, d_white, d_level):
    """-log L of every sample and channel, and its derivative by the unknowns."""
    return 0.5 * (white**2 + level), white[..., None] * d_white + 0.5 * d_level


class Samples(NamedTuple):
    """Of every sample and channel: whitened innovations and log S, zero where nothing was measured, and both their
    derivatives."""

    white: Float[Array, "E T ny"]
    level: Float[Array, "E T ny"]
    d_white: Float[Array, "E T ny p"]
    d_level: Float[Array, "E T ny p"]


def samples(names: tuple[str, ...], model: Model, problem: Problem, x: Float[Array, " p"]) -> Samples:
    """What the filter and its sensitivities say at `x`, of all experiments."""
    return Samples(*jax.vmap(lambda record: sensitivities(names, model, problem, x, record))(problem.records))


def reduced(problem: Problem, x: Float[Array, " p"], seen: Samples) -> Look:
    """-log L, gradient and information of what was `seen` at `x`. Knows nothing of the model."""
    n, p = problem.held.shape[0], x.shape[0]
    value, score = scores(*seen)
    change = seen.d_white + 0.5 * seen.white[..., None] * seen.d_level  # de / sqrt(S)
    rows = jnp.concatenate([change.reshape(-1, p), seen.d_level.reshape(-1, p) / jnp.sqrt(2.0)])
    pull, pulled = jax.value_and_grad(_pull, argnums=1)(problem, x[:n])
    slope = jnp.where(problem.free, problem.scale, 0.0)
    gradient = jnp.sum(score, axis=(0, 1, 2)).at[:n].add(pulled)
    information = (rows.T @ rows).at[:n, :n].add(jnp.diag(problem.prior_precision * slope**2))
    total = jnp.sum(value) + pull + _half_log_two_pi(problem)
    sound = jnp.isfinite(total) & jnp.all(jnp.isfinite(gradient)) & jnp.all(jnp.isfinite(information))
    return Look(jnp.where(sound, total, _DIVERGED), jnp.where(sound, gradient, 0.0), jnp.where(sound, information, 0.0))


def look(names: tuple[str, ...], model: Model, problem: Problem, x: Float[Array, " p"]) -> Look:
    """-log L, gradient and information at `x`. Coordinates that are not free have zeros."""
    return reduced(problem, x, samples(names, model, problem, x))
