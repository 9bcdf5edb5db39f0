"""Sensors that answer late, as a filter of the state has them.

A first-order lag `T dy'/dt = y - y'` is a state of its own for every output (state augmentation; Simon, Optimal State
Estimation, 2006, section 7.2), moved exactly for outputs that are straight lines over an integration step. Outputs that are
all stamped late by d are those of the same motion begun d later, so that the inputs are shifted by d instead: the filter's
state is then that of d earlier. Whatever else remembers earlier outputs is refused, other laws of a lag or a delay as well.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...effects.earlier import earlier
from ...effects.sensor import SensorDelay, SensorLag
from ...effects.sensor.outputs import sensed
from ...logs import LogSet
from ...robots.effect import Effect, Numbers
from ...robots.robot import Robot
from ...robots.signal_path import overrides, passed
from .cubature import Moments

_LEAST = 1e-9
"""Share of a step below which a lag is none."""
_PROBED = 6


def _is_lag(effect: Effect) -> bool:
    """Whether it is the first-order lag: the other laws of one derive from it, and are no such state."""
    return type(effect) is SensorLag


def _is_delay(effect: Effect) -> bool:
    """Whether it is one constant delay of all: the same."""
    return type(effect) is SensorDelay


def lag_of(robot: Robot) -> Effect | None:
    """The lag among the robot's effects."""
    return next((effect for effect in robot.effects if _is_lag(effect)), None)


def lagged_outputs(robot: Robot) -> tuple[str, ...]:
    """Outputs that a lag holds as states of the filter, which stand behind the robot's own."""
    return sensed(robot) if lag_of(robot) else ()


def _places(robot: Robot) -> np.ndarray:
    """Places of the lagged outputs among the measured channels."""
    return np.array([robot.channels.measured.index(name) for name in lagged_outputs(robot)], int)


def _measured(robot: Robot, effects: tuple[Effect, ...], y: Float[Array, " ny"], p: Numbers) -> Float[Array, " ny"]:
    late = [effect for effect in effects if not (_is_lag(effect) or _is_delay(effect))]
    return passed(replace(robot, effects=tuple(late)), "measure", y[None], jnp.zeros(1), p)[0]


def _halves(robot: Robot) -> tuple[tuple[Effect, ...], tuple[Effect, ...]]:
    """Effects up to the lag, and after it."""
    lag = lag_of(robot)
    at = robot.effects.index(lag) + 1 if lag else len(robot.effects)
    return robot.effects[:at], robot.effects[at:]


def before_lag(robot: Robot, p: Numbers, state, seen: Float[Array, " nu"]) -> Float[Array, " ny"]:
    """What arrives at the lag (or, without one, at the log) of a state."""
    y = jnp.stack([jnp.asarray(y, float) for y in robot.observe(state, tuple(seen), p)])
    return _measured(robot, _halves(robot)[0], y, p)


def shown(
    robot: Robot, p: Numbers, state, lagged: Float[Array, " nl"], seen: Float[Array, " nu"]
) -> Float[Array, " ny"]:
    """What the sensors show of a state and of the `lagged` outputs."""
    y = before_lag(robot, p, state, seen)
    if not lag_of(robot):
        return y
    y = y.at[_places(robot)].set(lagged)
    return _measured(robot, _halves(robot)[1], y, p)


def moved(robot: Robot, p: Numbers, lagged: Float[Array, " nl"], before, after, h) -> Float[Array, " nl"]:
    """The lagged outputs a step of `h` seconds later, while what arrives goes from `before` to `after` [ny]."""
    lag = lag_of(robot)
    if lag is None:
        return lagged
    before, after = before[_places(robot)], after[_places(robot)]
    T = p[lag.key("time_constant")]
    behind = T * (after - before) / h  # its derivative at no lag is that of a small one
    return after - behind + (lagged - (before - behind)) * jnp.exp(-h / jnp.maximum(T, _LEAST * h))


def with_lagged(robot: Robot, p: Numbers, start: Moments, seen: Float[Array, " nu"], as_state) -> Moments:
    """Moments of the state with the lagged outputs behind it, which begin where the outputs do."""
    if not lag_of(robot):
        return start
    places = _places(robot)

    def arrives(x):
        return before_lag(robot, p, as_state(robot, x), seen)[places]

    slope = jax.jacfwd(arrives)(start.mean)
    both = jnp.concatenate([jnp.eye(start.mean.shape[0]), slope])
    return Moments(jnp.concatenate([start.mean, arrives(start.mean)]), both @ start.covariance @ both.T)


def shifted(robot: Robot, p: Numbers, inputs: Float[Array, "T m nu"], dt: Float[Array, " T"]) -> Float[Array, "T m nu"]:
    """The inputs of every step, late by the sensors' delay; nothing acts before the start."""
    for effect in robot.effects:
        if not _is_delay(effect):
            continue
        T, m, nu = inputs.shape
        fine, steps = inputs.reshape(T * m, nu), jnp.repeat(dt / m, m)
        edges = jnp.concatenate([jnp.zeros(1), jnp.cumsum(steps)])
        whole = jnp.concatenate([jnp.zeros((1, nu)), jnp.cumsum(fine * steps[:, None], axis=0)])
        before, share = earlier(edges, p[effect.key("delay")])
        late = whole[before] + share[:, None] * (whole[before + 1] - whole[before])
        # Padding has steps of no length.
        means = jnp.diff(late, axis=0) / jnp.where(steps > 0, steps, 1.0)[:, None]
        inputs = jnp.where(steps[:, None] > 0, means, fine).reshape(T, m, nu)
    return inputs


def _remembers(robot: Robot, effect: Effect) -> bool:
    """Whether the effect's measurement of one sample depends on other samples as well."""
    if not overrides(type(effect), "measure"):
        return False
    numbers = dict(robot.parameters.numbers)
    for name, parameter in effect.parameters(robot).items():
        numbers[name] = numbers[name] or parameter.typical or 1.0
    alone = replace(robot, effects=(effect,))
    y = jnp.asarray(np.random.default_rng(0).normal(size=(_PROBED, len(robot.channels.measured))))
    time = jnp.arange(float(_PROBED)) * (numbers.get(effect.key("delay"), 0.0) or 1.0)
    slope = np.asarray(jax.jacfwd(lambda y: passed(alone, "measure", y, time, numbers))(y))
    return bool(np.any(np.abs(slope).sum(axis=(1, 3))[~np.eye(_PROBED, dtype=bool)] != 0))


def refusal(robot: Robot, logs: LogSet) -> str | None:
    """Why the filter cannot have the robot's sensors on these logs, in a sentence; None if it can."""
    others = [e for e in robot.effects if not (_is_lag(e) or _is_delay(e)) and _remembers(robot, e)]
    if others:
        named = ", ".join(f"{e.id} ({e.law})" if e.law else e.id for e in others)
        return (
            f"{named} remembers earlier outputs, which a filter of the state does not hold; take "
            "output error for this model, or leave the effect out"
        )
    late = sensed(robot)
    extra = [c for c in robot.channels.measured if c not in late and any(c in log.measured for log in logs)]
    if extra and any(_is_delay(e) for e in robot.effects):
        return (
            f"sensor_delay makes {', '.join(late)} late but not {', '.join(extra)}, and a filter has one "
            f"state at a time; leave {', '.join(extra)} out of the logs, or take output error for this model"
        )
    return None
