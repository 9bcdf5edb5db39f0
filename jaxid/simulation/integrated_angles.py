"""Wheel angles integrated from the measured speeds.

A ripple once per few degrees needs the wheel's angle to a fraction of that. A simulated angle drifts away within metres;
the sum of the measured speeds does not, for their noise averages out.
"""

from collections.abc import Mapping
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arrays import array
from .._compile import compiled
from .._float64 import in_float64
from ..logs import LogSet
from ..robots.effect import Numbers, State
from ..robots.robot import Robot


def _filled(signal: np.ndarray) -> np.ndarray:
    """Missing samples interpolated."""
    there = np.isfinite(signal)
    return (
        np.interp(np.arange(signal.size), np.flatnonzero(there), signal[there])
        if there.any()
        else np.zeros(signal.size)
    )


@partial(compiled, static_argnames=("robot",))
def _turning(robot: Robot, numbers: Numbers, at_rest: State, speeds: dict[str, Float[Array, "E T"]]):
    """How fast every wheel turns [E, T] at these speeds."""

    def rates(own: State) -> State:
        state = {**at_rest, **own}
        no_friction = (0.0,) * len(robot.rubbing(state, numbers))
        everything = robot.rates(state, (0.0,) * len(robot.channels.inputs), no_friction, numbers)
        return {name: jnp.asarray(everything[name], float) for name in robot.angles}

    return jax.vmap(jax.vmap(rates))(speeds)


@in_float64
def integrated_angles(robot: Robot, logs: LogSet) -> Mapping[str, Float[Array, "E T"]]:
    """The angles (rad; an axis: m) of the driving wheels since the start of each log, padded as in `logs.batch()`.

    Empty where the robot (with its effects) integrates no wheel angles, a velocity of it was not measured, or an angle is
    itself an output: with it prescribed, a model would have nothing left to predict.
    """
    outputs, measured = robot.channels.outputs, logs.channels.measured
    if not robot.angles or not {*robot.angles, *outputs} <= set(robot.states) or set(robot.angles) & set(outputs):
        return {}
    if any(not np.isfinite(log.output(name)).any() for log in logs for name in outputs):
        return {}
    batch = logs.batch()
    speeds = {name: np.asarray(batch.outputs)[..., measured.index(name)] for name in outputs}
    there = {name: np.asarray(batch.mask)[..., measured.index(name)] for name in outputs}
    speeds = {n: np.apply_along_axis(_filled, 1, np.where(there[n], v, np.nan)) for n, v in speeds.items()}
    numbers = {name: array(float(value)) for name, value in robot.parameters.numbers.items()}
    at_rest = {name: array(float(value)) for name, value in robot.initial_state().items()}
    dt, angles = np.asarray(batch.dt), {}
    for name, found in _turning(robot.structure, numbers, at_rest, speeds).items():
        rate = np.asarray(found)
        steps = 0.5 * (rate[:, :-1] + rate[:, 1:]) * dt[:, :-1]
        angles[name] = array(np.concatenate([np.zeros((len(logs), 1)), np.cumsum(steps, axis=1)], axis=1))
    return angles
