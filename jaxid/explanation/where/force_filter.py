"""Filter of the state and the missing forces of logs, compiled once for all of them.

`force_filter_directly` has the same filter for robots whose step is machine code, and the smoother.

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

from ..._compile import compiled
from ...estimate.prediction_error.cubature import Moments, carried, measured
from ...estimate.prediction_error.filter import as_state, filter_pass
from ...kernel.dense import solved
from ...robots.effect import Numbers
from ...robots.robot import Robot
from ...simulation.rollout import Integrator, begins_in_motion, commanded, step

PREFIX = "missing_force."
"""Names of the forces' states begin with this, and end with the velocity they accelerate."""
LEAST = 1e-3
"""Least variance of a state beside its jitter."""


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
    outputs = log["outputs"].shape[1]

    def onward(vector, volts, interval):
        def substep(state, held):
            return step(robot, state, tuple(held), interval / integrator.substeps, p, integrator.friction), None

        state, _ = jax.lax.scan(substep, as_state(robot, vector), volts)
        return jnp.stack([state[name] for name in robot.states])

    def look(vector, seen):
        # Effects on measurements are taken off the data beforehand.
        return jnp.stack([jnp.asarray(y, float) for y in robot.observe(as_state(robot, vector), tuple(seen), p)])[
            :outputs
        ]

    def propagate(moments: Moments, row):
        volts, interval = row
        wider = Moments(moments.mean, moments.covariance + jnp.diag(log["jitter"]))
        ahead, cross = carried(wider, lambda x: onward(x, volts, interval), LEAST * log["jitter"])
        ahead = Moments(ahead.mean, ahead.covariance + _walked(setting, intensity, interval, log))
        return ahead, (ahead, cross)

    held = begins_in_motion(robot, dict(zip(robot.states, log["start"], strict=True)))
    volts = commanded(robot, p, log["inputs"], log["dt"], integrator.substeps, held)
    start = Moments(log["start"], _start_covariance(setting, intensity, log))
    rows = ((volts, log["dt"]), volts[:, 0], log["outputs"], log["there"])
    found = filter_pass(look, propagate, start, rows, log["noise"])
    before, after, expected, slope, _, (ahead, cross) = found
    return after.mean, after.covariance, ahead.mean, ahead.covariance, cross, expected, slope, before.mean


def _walks(setting: Setting):
    return jnp.array([setting.robot.states.index(PREFIX + name) for name in setting.velocities])


def _walked(setting: Setting, intensity, interval, log):
    """Covariance that one sample adds: the forces' random walk, and the integration's own error."""
    return jnp.diag(log["jitter"].at[_walks(setting)].set(intensity**2 * interval))


def _start_covariance(setting: Setting, intensity, log):
    return jnp.diag(log["spread"].at[_walks(setting)].set(log["begun"] * intensity) ** 2)


def _likelihood(setting: Setting, log, kept, used, intensity):
    """Log-likelihood of one log at `intensity`, linearised where a filter at the intensity `used` has been."""
    means, covariances, after, covariances_after, crosses, expected, slopes, predicted = kept

    def sample(carry, row):
        mean, covariance, total = carry
        base, base_covariance, next_, next_covariance, cross, expected, slope, predicted, y, there, interval = row
        expected = expected + slope @ (mean - predicted)
        (mean, covariance), news = measured(Moments(mean, covariance), expected, slope, y, there, log["noise"])
        gained = -0.5 * jnp.sum(news.surprise**2 / news.variance + jnp.log(news.variance))
        # Statistical linear regression: the matrix that the points' moments imply, and what it leaves over.
        spread = base_covariance + jnp.diag(log["jitter"])
        turn = solved(spread, cross).T
        left = next_covariance - turn @ cross - _walked(setting, used, interval, log)
        covariance = turn @ covariance @ turn.T + left + _walked(setting, intensity, interval, log)
        return (next_ + turn @ (mean - base), _symmetric(covariance), total + gained), None

    start = (log["start"], _start_covariance(setting, intensity, log), jnp.zeros(()))
    moments = (means, covariances, after, covariances_after, crosses, expected, slopes, predicted)
    (_, _, total), _ = jax.lax.scan(sample, start, (*moments, log["outputs"], log["there"], log["dt"]))
    return total


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
