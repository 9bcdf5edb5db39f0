"""Filter and smoother of the state and the missing forces of logs, compiled once for all of them.

The moments are carried through the rollout's own steps at cubature points (Arasaratnam & Haykin, Cubature Kalman
filters, IEEE Trans. Automatic Control 54, 2009; smoother: Särkkä, Unscented Rauch-Tung-Striebel smoother, ibid. 53,
2008), not by derivatives. A model that sticks has a derivative of zero with respect to the force: an extended filter
would stay blind when the real robot moves and the model does not. The points spread as far as the force is uncertain,
so that they reach beyond break-away once that is possible.
"""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp

from .._compile import compiled
from ..robots.effect import Numbers, State
from ..robots.robot import Robot
from ..simulation.rollout import Integrator, commanded, step

PREFIX = "missing_force."
"""Names of the forces' states begin with this, and end with the velocity they accelerate."""
_START = 2.0
"""Standard deviation of a force at the start, in units of what it wanders in one second."""


def _points(mean, covariance):
    """Cubature points [2n, n] of a Gaussian."""
    n = mean.shape[0]
    spread = jnp.sqrt(float(n)) * jnp.linalg.cholesky(covariance).T
    return jnp.concatenate([mean + spread, mean - spread])


def _symmetric(matrix):
    return 0.5 * (matrix + matrix.T)


@dataclass(frozen=True)
class Setting:
    """What a compiled filter depends on."""

    robot: Robot
    integrator: Integrator
    velocities: tuple[str, ...]


def _filter(setting: Setting, p: Numbers, log, intensity):
    """Forward pass over one log at cubature points: for every sample what the smoother and a linear filter need.

    Mean and covariance after the measurement; the next sample's before its measurement; their cross-covariance; the
    expected outputs and their slope, and the mean at which these were taken.
    """
    robot, integrator = setting.robot, setting.integrator
    names = robot.states
    outputs = log["outputs"].shape[1]

    def as_state(vector) -> State:
        return {name: vector[i] for i, name in enumerate(names)}

    def advance(vector, volts, interval):
        def substep(state, held):
            return step(robot, state, tuple(held), interval / integrator.substeps, p, integrator.friction), None

        state, _ = jax.lax.scan(substep, as_state(vector), volts)
        return jnp.stack([state[name] for name in names])

    def observe(vector, seen):
        return jnp.stack([jnp.asarray(y, float) for y in robot.observe(as_state(vector), tuple(seen), p)])[:outputs]

    def sample(carry, row):
        predicted, covariance = carry
        volts, y, there, interval = row
        expected, slope = observe(predicted, volts[0]), jax.jacfwd(observe)(predicted, volts[0])
        mean, covariance, _ = _measured(predicted, covariance, expected, slope, y, there, log["noise"])
        points = _points(mean, covariance + jnp.diag(log["jitter"]))
        ahead = jax.vmap(lambda point: advance(point, volts, interval))(points)
        after = jnp.mean(ahead, axis=0)
        spread, before = ahead - after, points - mean
        covariance_after = spread.T @ spread / len(points) + _walked(setting, intensity, interval, log)
        cross = before.T @ spread / len(points)
        return (after, covariance_after), (mean, covariance, after, covariance_after, cross, expected, slope, predicted)

    volts = commanded(robot, p, log["inputs"], log["dt"], integrator.substeps)
    rows = (volts, log["outputs"], log["there"], log["dt"])
    _, kept = jax.lax.scan(sample, (log["start"], _start_covariance(setting, intensity, log)), rows)
    return kept


def _measured(mean, covariance, expected, slope, y, there, noise):
    """Mean, covariance and log-likelihood after one sample's outputs, one after the other: their noises are independent."""
    first, likelihood = mean, jnp.zeros(())
    for i in range(len(y)):
        surprise = y[i] - expected[i] - slope[i] @ (mean - first)
        along = covariance @ slope[i]
        variance = slope[i] @ along + noise[i] ** 2
        gain = jnp.where(there[i], along / variance, 0.0)
        mean = mean + gain * surprise
        covariance = _symmetric(covariance - jnp.outer(gain, along))
        likelihood = likelihood - 0.5 * jnp.where(there[i], surprise**2 / variance + jnp.log(variance), 0.0)
    return mean, covariance, likelihood


def _walks(setting: Setting):
    return jnp.array([setting.robot.states.index(PREFIX + name) for name in setting.velocities])


def _walked(setting: Setting, intensity, interval, log):
    """Covariance that one sample adds: the forces' random walk, and the integration's own error."""
    return jnp.diag(log["jitter"].at[_walks(setting)].set(intensity**2 * interval))


def _start_covariance(setting: Setting, intensity, log):
    return jnp.diag(log["spread"].at[_walks(setting)].set(_START * intensity) ** 2)


def _likelihood(setting: Setting, log, kept, used, intensity):
    """Log-likelihood of one log at `intensity`, linearised where a filter at the intensity `used` has been."""
    means, covariances, after, covariances_after, crosses, expected, slopes, predicted = kept

    def sample(carry, row):
        mean, covariance, total = carry
        base, base_covariance, next_, next_covariance, cross, expected, slope, predicted, y, there, interval = row
        expected = expected + slope @ (mean - predicted)
        mean, covariance, gained = _measured(mean, covariance, expected, slope, y, there, log["noise"])
        # Statistical linear regression: the matrix that the points' moments imply, and what it leaves over.
        spread = base_covariance + jnp.diag(log["jitter"])
        turn = jax.scipy.linalg.cho_solve((jnp.linalg.cholesky(spread), True), cross).T
        left = next_covariance - turn @ cross - _walked(setting, used, interval, log)
        covariance = turn @ covariance @ turn.T + left + _walked(setting, intensity, interval, log)
        return (next_ + turn @ (mean - base), _symmetric(covariance), total + gained), None

    start = (log["start"], _start_covariance(setting, intensity, log), jnp.zeros(()))
    moments = (means, covariances, after, covariances_after, crosses, expected, slopes, predicted)
    (_, _, total), _ = jax.lax.scan(sample, start, (*moments, log["outputs"], log["there"], log["dt"]))
    return total


def _smooth(kept):
    """Smoothed mean and standard deviation [T, n states] of one log, from its filter's moments."""
    mean, covariance, ahead, ahead_covariance, cross = kept[:5]

    def back(later, row):
        later_mean, later_covariance = later
        mean, covariance, ahead, ahead_covariance, cross = row
        gain = jax.scipy.linalg.cho_solve((jnp.linalg.cholesky(ahead_covariance), True), cross.T).T
        mean = mean + gain @ (later_mean - ahead)
        covariance = _symmetric(covariance + gain @ (later_covariance - ahead_covariance) @ gain.T)
        return (mean, covariance), (mean, jnp.sqrt(jnp.maximum(jnp.diag(covariance), 0.0)))

    # The last sample has no later one: start from its own prediction, which says nothing new.
    end = (ahead[-1], ahead_covariance[-1])
    _, found = jax.lax.scan(back, end, (mean, covariance, ahead, ahead_covariance, cross), reverse=True)
    return found


@partial(compiled, static_argnames="setting")
def filtered(setting: Setting, numbers, logs, intensity):
    """The filter's moments of every log at one random-walk `intensity` [n forces]: the leaves are [E, T, ...]."""
    return jax.vmap(lambda log: _filter(setting, numbers, log, intensity))(logs)


@partial(compiled, static_argnames="setting")
def likelihoods(setting: Setting, logs, kept, used, intensities):
    """Log-likelihood of all logs together for every row of `intensities` [lanes, n]."""

    def lane(intensity):
        return jnp.sum(jax.vmap(lambda log, own: _likelihood(setting, log, own, used, intensity))(logs, kept))

    return jax.vmap(lane)(intensities)


smoothed = compiled(jax.vmap(_smooth))
"""Smoothed mean and standard deviation [E, T, n states] from the moments of `filtered`."""
