"""What measured outputs say of a robot's velocities, and where it drove: dead reckoning, written once for all robots."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from .._float64 import in_float64
from ..logs import Log
from ..robots.robot import Robot

Array = NDArray[np.float64]


@cache
@in_float64
def readout(robot: Robot) -> tuple[tuple[str, ...], Array] | None:
    """Outputs, and the matrix [velocities, outputs] that makes the robot's velocities of them.

    None where the outputs are no linear function of the velocities alone, or do not tell all of them.
    """
    outputs = robot.channels.outputs
    inverse = readout_of(robot, outputs)
    return None if inverse is None else (outputs, inverse)


@cache
@in_float64
def readout_of(robot: Robot, outputs: tuple[str, ...]) -> Array | None:
    """The matrix [velocities, outputs] that makes the robot's velocities of these of its outputs; None where they are no linear
    function of the velocities alone, or do not tell all of them."""
    names, places = robot.velocities, [robot.channels.outputs.index(name) for name in outputs]
    p, rest = robot.parameters.numbers, robot.initial_state()
    idle = (0.0,) * len(robot.channels.inputs)
    if not names or not outputs:
        return None

    def seen(v):
        state = {**rest, **dict(zip(names, v, strict=True))}
        shown = robot.observe(state, idle, p)
        return jnp.stack([jnp.asarray(shown[k], float) for k in places])

    return _inverse(seen, len(names))


@in_float64
def angle_rates_of(robot: Robot) -> Array:
    """The matrix [angles, outputs] that makes the rates of a robot's angles of its outputs, where these tell its velocities."""
    outputs, rest, columns = robot.channels.outputs, robot.initial_state(), []
    for name in outputs:
        one = velocities_of(robot, {each: np.full(1, float(each == name)) for each in outputs}, np.zeros(1))
        rates = robot.angle_rates({**rest, **one}, robot.parameters.numbers)
        columns.append([float(np.asarray(rate).reshape(-1)[0]) for rate in rates])
    return np.array(columns).T


@cache
@in_float64
def wheel_readout(robot: Robot) -> Array | None:
    """The matrix [velocities, angles] that makes the robot's velocities of the rates of its wheels' angles; None where these
    are no linear function of the velocities alone, or do not tell all of them."""
    names, angles = robot.velocities, robot.measured_angles
    p, rest = robot.parameters.numbers, robot.initial_state()
    if not angles or angles != robot.angles:
        return None

    def turning(v):
        rates = robot.angle_rates({**rest, **dict(zip(names, v, strict=True))}, p)
        return jnp.stack([jnp.asarray(rate, float) for rate in rates])

    return _inverse(turning, len(names))


@cache
@in_float64
def position_readout(robot: Robot) -> Array | None:
    """The matrix [velocities, outputs] that makes the positions, whose derivatives the robot's velocities are, of its outputs;
    None where these are no linear function of the positions alone, such as an angle in degrees, or do not tell all of them."""
    places = [robot.positions.get(name, "") for name in robot.velocities]
    outputs = robot.channels.outputs
    p, rest = robot.parameters.numbers, robot.initial_state()
    idle = (0.0,) * len(robot.channels.inputs)
    if not places or not all(name in robot.own_states for name in places):
        return None

    def seen(q):
        state = {**rest, **dict(zip(places, q, strict=True))}
        return jnp.stack([jnp.asarray(y, float) for y in robot.observe(state, idle, p)[: len(outputs)]])

    return _inverse(seen, len(places))


def _inverse(seen: Callable[[Any], Any], velocities: int) -> Array | None:
    """The pseudo-inverse of a linear function of the velocities; None where it is none, or loses some of them."""
    zero, some = jnp.zeros(velocities), jnp.arange(1.0, 1.0 + velocities)
    try:
        slope = np.asarray(jax.jacfwd(seen)(zero))
        at_rest, elsewhere = np.asarray(seen(zero)), np.asarray(seen(some))
    except (TypeError, ValueError, KeyError, ArithmeticError):
        return None
    linear = np.allclose(at_rest, 0.0) and np.allclose(elsewhere, slope @ np.asarray(some))
    return np.linalg.pinv(slope) if linear and np.linalg.matrix_rank(slope) == velocities else None


def _rate(values: Array, time: Array, smooth=lambda y: y) -> Array:
    """Rate of change [T] of a position by central differences between its measurements, NaN where there is none."""
    there, found = np.isfinite(values), np.full(len(time), np.nan)
    if there.all():
        return np.gradient(smooth(values), time)
    if there.sum() > 1:
        found[there] = np.gradient(smooth(values[there]), time[there])
    return found


def velocities_of(robot: Robot, columns: Mapping[str, Array], time: Array, smooth=lambda y: y) -> dict[str, Array]:
    """The robot's velocities [T] by name from measured `columns` [T]; NaN where they do not tell one.

    Measured ones as they are, else the derivative of the position that was measured, `smooth`ed before, else what the
    outputs say together (speeds of wheels, or positions in another unit), or the rates of the wheels' angles.
    A robot that names no velocities has its outputs for them.
    """
    missing = np.full(len(time), np.nan)
    found: dict[str, Array] = {}
    for name in robot.velocities or robot.channels.outputs:
        values = columns.get(name, missing)
        own = robot.channels.stand_ins(name)
        position = own[0] if len(own) == 1 else robot.positions.get(name)
        if not np.isfinite(values).any() and position is not None and position in columns:
            values = _rate(columns[position], time, smooth)
        found[name] = values
    unknown = [name for name, values in found.items() if not np.isfinite(values).any()]
    sensors = readout(robot) if unknown else None
    if sensors is not None and all(name in columns for name in sensors[0]):
        together = sensors[1] @ np.stack([columns[name] for name in sensors[0]])
        return found | {name: together[robot.velocities.index(name)] for name in unknown}
    places = position_readout(robot) if unknown else None
    if places is not None and all(name in columns for name in robot.channels.outputs):
        together = places @ np.stack([_rate(columns[name], time, smooth) for name in robot.channels.outputs])
        return found | {name: together[robot.velocities.index(name)] for name in unknown}
    wheels = wheel_readout(robot) if unknown else None
    if wheels is not None and all(name in columns for name in robot.measured_angles):
        together = wheels @ np.stack([_rate(columns[name], time, smooth) for name in robot.measured_angles])
        found |= {name: together[robot.velocities.index(name)] for name in unknown}
    return found


def measured_velocities(robot: Robot, log: Log, smooth=lambda y: y) -> dict[str, Array]:
    """`velocities_of` one log, columns beside the channels included."""
    columns = {name: log.output(name) for name in log.channels.measured}
    for name in robot.velocities:
        if name not in columns and name in log.extra.columns:  # measured, but not what the model is fitted to
            columns[name] = log.extra[name].to_numpy(dtype=float)
    return velocities_of(robot, {n: y for n, y in columns.items() if np.isfinite(y).any()}, log.time, smooth)


def measured_states(robot: Robot, log: Log) -> dict[str, Array]:
    """Outputs of a log that are the robot's own states, gaps filled from their neighbours.

    These are velocities, and what else says how it moves, such as the yaw rate of a car, which no force accelerates.
    """
    found = {}
    for name in robot.own_states:
        values = log.output(name) if name in log.measured else np.zeros(0)
        there = np.flatnonzero(np.isfinite(values))
        if len(there):
            found[name] = np.interp(np.arange(len(values)), there, values[there])
    return found


def reckoned(
    robot: Robot, speeds: Mapping[str, Array], dt: Array, start: Mapping[str, float] | None = None
) -> tuple[Array | None, Array | None]:
    """Heading [..., T] rad and positions [..., T, 2] m by trapezoids from `speeds` [..., T] and the intervals [T - 1] between
    them, from `start` (x, y, theta): the robot's velocities, and other states that say how it moves. One that moves along a
    line has no heading and positions [..., T, 1]; both are None for a robot that does not say how it moves.
    """
    begin = start or {}

    def summed(rate: Array, name: str) -> Array:
        steps = 0.5 * dt * (rate[..., 1:] + rate[..., :-1])
        zero = np.zeros((*rate.shape[:-1], 1))
        return begin.get(name, 0.0) + np.concatenate([zero, np.cumsum(steps, axis=-1)], axis=-1)

    if robot.in_plane and set(robot.velocities) <= set(speeds):
        state = {**robot.initial_state(), **speeds}
        zero = 0.0 * speeds[robot.velocities[0]]
        along, left, turning = (zero + rate for rate in robot.planar(state, robot.parameters.numbers))
        heading = summed(turning, "theta")
        cosine, sine = np.cos(heading), np.sin(heading)
        x, y = summed(cosine * along - sine * left, "x"), summed(sine * along + cosine * left, "y")
        return heading, np.stack([x, y], axis=-1)
    if robot.along_line and robot.velocities[0] in speeds:
        return None, summed(speeds[robot.velocities[0]], "x")[..., None]
    return None, None
