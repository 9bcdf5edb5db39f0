"""Other values of a model's parameters by which it moves as it does.

Where several numbers can all change together and nothing of it is seen, a search cannot get from one of these models to
another: with one number held elsewhere than it is, all the rest begins wrong, and from there a fit ends in whatever minimum is
near. The equations of motion say where the rest has to begin: the accelerations at states that the logs show are to be the
same, which is a small problem of least squares and needs no simulation.
"""

from collections.abc import Mapping, Sequence
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ..._compile import compiled
from ..._float64 import in_float64
from ...logs import LogSet
from ...robots.rates_in_motion import rates_in_motion
from ...robots.robot import Robot

Array = NDArray[np.float64]
Seen = tuple[dict[str, Array], tuple[Array, ...]]
"""States by name [N] and inputs by channel [N]."""
_STATES, _FEWEST = 300, 30
"""About how many states of the logs are looked at, and how few are none."""
_ON_THE_WAY = 4
"""Steps in which a number is moved: products of parameters are far from linear."""
_CORRECTIONS = 4
"""Gauss-Newton steps after each."""
_ALIKE = 1e-4
"""Share of what a number does to the accelerations that may be left for a model to move alike."""
_RANK = 1e-9
"""Singular values below this share of the largest are directions that no acceleration tells."""


def seen_in(robot: Robot, logs: LogSet) -> Seen | None:
    """States and inputs at about 300 samples of the logs; None where these do not measure every velocity, or hardly ever."""
    names = logs.channels.measured
    if not robot.velocities or not set(robot.velocities) <= set(names):
        return None
    step = max(sum(len(log) for log in logs) // _STATES, 1)
    outputs = np.concatenate([log.outputs for log in logs])[::step]
    inputs = np.concatenate([log.inputs for log in logs])[::step]
    there = np.isfinite(outputs[:, [names.index(n) for n in robot.velocities]]).all(axis=1)
    if there.sum() < _FEWEST:
        return None
    still = dict.fromkeys(robot.states, np.zeros(int(there.sum()))) | {
        name: np.full(int(there.sum()), value) for name, value in robot.initial_state().items()
    }
    return {**still, **{n: outputs[there, names.index(n)] for n in robot.velocities}}, tuple(inputs[there].T)


@partial(compiled, static_argnames=("robot", "names"))
def _accelerations_and_slopes(robot: Robot, names: tuple[str, ...], numbers, values, state, inputs):
    def accelerations(values):
        p = {**numbers, **dict(zip(names, values, strict=True))}
        return rates_in_motion(robot, robot.velocities, state, inputs, p).T.reshape(-1)

    return accelerations(values), jax.jacfwd(accelerations)(values)


@in_float64
def accelerations(robot: Robot, names: Sequence[str], values: Array, seen: Seen) -> tuple[Array, Array]:
    """The accelerations of the sliding robot [velocities · N] in states that were seen, with these values of its parameters
    `names`, and their derivatives by these [velocities · N, names]."""
    known = {name: float(value) for name, value in robot.parameters.numbers.items()}
    found, slopes = _accelerations_and_slopes(robot.structure, tuple(names), known, jnp.asarray(values), *seen)
    return np.asarray(found), np.asarray(slopes)


def values_moving_alike(robot: Robot, held: str, value: float, logs: LogSet) -> Mapping[str, float]:
    """Values of the other free parameters with which `robot` accelerates as it does, in states that the logs show, with its
    parameter `held` at `value`; empty where there are none, and where the equations of motion alone do not say it."""
    stateless = not any(effect.states_on(robot) for effect in robot.effects)
    seen = seen_in(robot, logs) if stateless and not robot.controlled else None
    names = [name for name in robot.parameters.free_names if name != held]
    if seen is None or not names:
        return {}
    every = (*names, held)
    begin = np.array([robot.parameters[name].value for name in every])
    wanted, slopes = accelerations(robot, every, begin, seen)
    moved = np.linalg.norm(slopes[:, -1]) * abs(value - begin[-1])
    values = begin.copy()
    for step in range(1, _ON_THE_WAY + 1):
        values[-1] = begin[-1] + (value - begin[-1]) * step / _ON_THE_WAY
        for _ in range(_CORRECTIONS):
            there, slopes = accelerations(robot, every, values, seen)
            if not (np.isfinite(there).all() and np.isfinite(slopes).all()):
                return {}
            size = np.linalg.norm(slopes[:, :-1], axis=0)
            size[size == 0] = np.inf
            change = np.linalg.lstsq(slopes[:, :-1] / size, wanted - there, rcond=_RANK)[0] / size
            values[:-1] += change
    left = accelerations(robot, every, values, seen)[0] - wanted
    if not np.linalg.norm(left) <= _ALIKE * moved:
        return {}
    found = dict(zip(names, values[:-1].tolist(), strict=True))
    inside = all(robot.parameters[name].inside(x) == x for name, x in found.items())
    return found if inside else {}
