"""Curves of several mechanisms that are one function of one variable on a robot: one model by several names.

On one axis a drag and a friction that is not proportional to the speed are the same curve, and on a robot whose drive axes are
its body's every one of them is. That is asked of the equations, not of refits: what a curve adds to the accelerations at
states that the logs show is compared with what another mechanism's curve can add there, and other values of the fitted
parameters with it.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ..._compile import compiled
from ..._float64 import in_float64
from ...effects import catalogue, laws_of
from ...effects.curve import Curve
from ...logs import LogSet
from ...robots.robot import Robot
from ...robots.traits import on_whole_signals
from ..refits.refit import Trial

Array = NDArray[np.float64]
_STATES = 300
"""About how many states of the logs are looked at."""
_SAME = 0.01
"""Share of what a curve adds (its square) that another may lack and be the same: what points in other places leave of it."""


def _seen(robot: Robot, logs: LogSet) -> tuple[dict[str, Array], tuple[Array, ...]] | None:
    """States [N] and inputs [N] at samples of the logs; None where these do not measure every velocity."""
    names = logs.channels.measured
    if not set(robot.velocities) <= set(names):
        return None
    step = max(sum(len(log) for log in logs) // _STATES, 1)
    outputs = np.concatenate([log.outputs for log in logs])[::step]
    inputs = np.concatenate([log.inputs for log in logs])[::step]
    there = np.all(np.isfinite(outputs[:, [names.index(n) for n in robot.velocities]]), axis=1)
    still = dict.fromkeys(robot.states, np.zeros(int(there.sum()))) | {
        name: np.full(int(there.sum()), value) for name, value in robot.initial_state().items()
    }
    return {**still, **{n: outputs[there, names.index(n)] for n in robot.velocities}}, tuple(inputs[there].T)


@partial(compiled, static_argnames=("robot", "names"))
def _slopes(robot: Robot, names: tuple[str, ...], numbers, values, state, inputs):
    """Derivatives of the accelerations of the sliding robot by the parameters `names` [N velocities, names]."""

    def accelerations(values):
        p = {**numbers, **dict(zip(names, values, strict=True))}
        pairs = zip(robot.coulomb(state, p), robot.rubbing(state, p), strict=True)
        dry = tuple(jnp.where(speed > 0.0, ahead, -back) * (speed != 0.0) for (back, ahead), speed in pairs)
        rates = robot.rates(state, tuple(inputs), dry, p)
        return jnp.concatenate([jnp.broadcast_to(rates[name], state[name].shape) for name in robot.velocities])

    return jax.jacfwd(accelerations)(values)


def _changes(robot: Robot, names: Sequence[str], state: dict, inputs: Sequence[Array]) -> Array:
    """What the parameters `names` add to the accelerations of the sliding robot, one by one [names, N velocities]."""
    known = {name: float(value) for name, value in robot.parameters.numbers.items()}
    begin = np.array([known[name] for name in names])
    return np.asarray(_slopes(robot.structure, tuple(names), known, begin, state, inputs)).T


def _left(columns: Array, wanted: Array) -> Array:
    """What the columns [n, N] cannot do of what is wanted [N], by least squares."""
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    columns = columns[size[:, 0] > 0] / size[size[:, 0] > 0]
    return wanted - columns.T @ np.linalg.lstsq(columns.T, wanted, rcond=1e-9)[0] if len(columns) else wanted


def _heights(effect: Curve, robot: Robot) -> list[str]:
    return [effect.height(k, name) for name in effect.each(robot) for k in effect.varying]


@in_float64
def curves_that_are(before: Trial, after: Trial, promised: Collection[str], logs: LogSet) -> tuple[str, ...]:
    """The ids of mechanisms, of those that `promised` something, whose curves, of no more points, add to the model `before`
    what the curve of `after` does; none where the logs do not show the robot's velocities."""
    curve, robot, bare = after.effect, after.robot, before.robot
    if not isinstance(curve, Curve) or on_whole_signals(curve) or curve.states_on(robot) or after.angles:
        return ()
    seen = _seen(bare, logs) if bare.velocities and not bare.controlled else None
    if seen is None or not bare.drive_axes:
        return ()
    own = _heights(curve, robot)
    values = np.array([robot.parameters[name].value for name in own])
    wanted = values @ _changes(robot, own, *seen)
    taken_up = _changes(bare, bare.parameters.free_names, *seen)
    whole = float(np.sum(_left(taken_up, wanted) ** 2))
    found = []
    for other in (effect for effect in catalogue(bare) if effect.id in promised):
        law = next((law for law in laws_of(bare, other.id) if isinstance(law, Curve)), None)
        if law is None or other.id == curve.id or on_whole_signals(law) or law.states_on(bare) or "pose" in law.needs:
            continue
        apart = curve.apart and len(law.parts(bare)) > 1
        dense = replace(law, apart=apart, between=curve.between)
        model = bare + dense
        names = _heights(dense, model)
        if len(names) > len(own):
            continue
        columns = np.concatenate([taken_up, _changes(model, names, *seen)])
        share = float(np.sum(_left(columns, wanted) ** 2)) / max(whole, 1e-300)
        if share < _SAME:
            found.append(other.id)
    return tuple(found)
