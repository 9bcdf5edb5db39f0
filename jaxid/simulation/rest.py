"""Which parameters a robot at rest would show its first samples with, where outputs answer inputs at once.

A current, or an accelerometer, shows at standstill what the input and the parameters make of it. With start values that are
far off, that is far from what was measured, and the robot seems to start in motion, or hot. So it is first seen how much of
the first samples of all logs together other values of the free parameters would explain, by Gauss-Newton with weights that
let a few logs start elsewhere (iteratively reweighted least squares: Holland & Welsch, Communications in Statistics 6, 1977).
"""

import math
from collections.abc import Sequence
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from .._arrays import array
from .._compile import compiled
from .._float64 import in_float64
from ..robots.effect import Numbers, State
from ..robots.robot import Robot

_STEPS, _RANK = 12, 1e-8
"""Gauss-Newton steps, and the share of the largest slope below which one says nothing."""
_LONGEST, _SMALL = 1.5, 1e-3
"""Largest step of a parameter, of the logarithm of a positive one or in units of its magnitude; and one that ends the
search."""


@partial(compiled, static_argnames=("robot", "names", "count"))
def _observed(robot: Robot, names: tuple[str, ...], numbers: Numbers, state: State, inputs: Array, count: int):
    """The first outputs of a state [count], and their derivatives by the parameters `names` and by the inputs."""

    def outputs(free, u):
        p = {**numbers, **dict(zip(names, free, strict=True))}
        return jnp.stack([jnp.asarray(y, float) for y in robot.observe(state, tuple(u), p)[:count]])

    free = jnp.stack([jnp.asarray(numbers[name], float) for name in names])
    return outputs(free, inputs), *jax.jacfwd(outputs, argnums=(0, 1))(free, inputs)


@in_float64
def explaining_rest(
    robot: Robot,
    states: Sequence[State],
    inputs: Float[NDArray, "E nu"],
    first: Float[NDArray, "E ny"],
    least: Float[NDArray, "E ny"],
) -> Robot:
    """The robot with values of its free parameters with which more of its outputs at rest are those measured.

    - `states`: of every log, at rest; `inputs` and `first`: its first row; `first` is NaN where nothing was measured.
    - `least`: differences that count as none, in the channels' units.

    Judged are the outputs that answer an input at once. The robot itself where there are none, and where it has no free
    parameter that matters to them.
    """
    names, table, numbers = robot.parameters.free_names, robot.parameters, robot.parameters.numbers
    if not names:
        return robot
    values = np.array([numbers[name] for name in names])
    positive = np.array([table[name].lower >= 0.0 and numbers[name] > 0.0 for name in names])
    sizes = np.where(positive, 1.0, [abs(numbers[n]) or table[n].typical or 1.0 for n in names])
    count = first.shape[1]

    def at(z) -> NDArray[np.float64]:
        with np.errstate(over="ignore"):
            return np.where(positive, values * np.exp(z), values + sizes * z)

    def seen(z) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Outputs [E, ny], and their derivatives by `z` [E, ny, n] and by the inputs [E, ny, nu]."""
        moved = at(z)
        p = {name: array(float(value)) for name, value in {**numbers, **dict(zip(names, moved, strict=True))}.items()}
        each = [
            _observed(robot.structure, names, p, {k: array(float(x)) for k, x in state.items()}, array(u), count)
            for state, u in zip(states, inputs, strict=True)
        ]
        y, by_parameter, by_input = (
            np.stack([np.asarray(part) for part in parts]) for parts in zip(*each, strict=True)
        )
        return y, by_parameter * np.where(positive, moved, sizes), by_input

    z = np.zeros(len(names))
    y, slopes, by_input = seen(z)
    told = np.isfinite(first) & np.any(by_input != 0.0, axis=(0, 2))
    unit = np.where(least > 0, least, 1.0)
    r = np.where(told, np.nan_to_num(first) - y, 0.0) / unit
    begun = np.sum(np.abs(r))
    best, found = begun, z
    for _ in range(_STEPS if told.any() else 0):
        slopes = np.where(told[..., None], slopes, 0.0) / unit[..., None]
        if not (np.isfinite(r).all() and np.isfinite(slopes).all()):
            break
        weight = 1.0 / np.sqrt(np.maximum(np.abs(r), 1.0))
        step = np.linalg.pinv((weight[..., None] * slopes).reshape(-1, len(z)), rcond=_RANK) @ (weight * r).ravel()
        z = z + np.clip(step, -_LONGEST, _LONGEST)
        y, slopes, _ = seen(z)
        r = np.where(told, np.nan_to_num(first) - y, 0.0) / unit
        if np.sum(np.abs(r)) < best:
            best, found = np.sum(np.abs(r)), z
        if np.max(np.abs(step)) < _SMALL:
            break
    if not best < begun:
        return robot
    lower, upper = (np.array([getattr(table[name], side) for name in names]) for side in ("lower", "upper"))
    moved = np.clip(at(found), lower, upper)
    return robot.with_values(**{n: float(v) for n, v in zip(names, moved, strict=True) if math.isfinite(v)})
