"""What effects on sensors share: which channels they act on.

These are the outputs, and the positions that may be measured beside or in the place of them (an axis's position, the angles of
wheels). Other optional channels, such as motor currents, keep out of it.
"""

import jax.numpy as jnp

from ...robots.effect import Effect, Numbers
from ...robots.robot import Robot
from ..actuator.drives import other_inputs


def sensed(robot: Robot) -> tuple[str, ...]:
    """The channels that sensors of the motion measure: outputs, then positions."""
    channels = robot.channels
    places = {*channels.positions, *robot.measured_angles}
    return (*channels.outputs, *(name for name in channels.optional if name in places))


def all_late(robot: Robot) -> bool:
    """Whether commands that are all late and sensors that are all late are one: all inputs drive, and all that is measured is
    of the motion."""
    return not other_inputs(robot) and set(sensed(robot)) >= set(robot.channels.measured)


def each_channel(effect: Effect, p: Numbers, stem: str, robot: Robot):
    """The effect's parameter `stem_NAME` of every channel, 0 where it has none, [ny]."""
    keys = [effect.key(f"{stem}_{name}") for name in robot.channels.measured]
    return jnp.stack([jnp.asarray(p[key], float) if key in p else jnp.zeros(()) for key in keys])


def sensed_only(robot: Robot, changed, outputs):
    """`changed` for what sensors of the motion measure, `outputs` for the other channels, both [T, ny]."""
    names = sensed(robot)
    return jnp.where(jnp.array([name in names for name in robot.channels.measured]), changed, outputs)


def first_slope(y, time):
    """Slope of y [T, ny] at the first stamp: before it, what moves is taken to have moved on a straight line."""
    return (y[1] - y[0]) / (time[1] - time[0])


def bends(y, time, ahead=False):
    """Second derivative of y [T, ny] within each interval [T - 1, ny]: the smaller of those at its start and one sample before.

    Inputs change at samples and put kinks there; those belong to no interval. A reading knows nothing of the sample after it:
    in a closed loop that one answers this reading's noise, and a law that looked there would follow it. With `ahead`, for laws
    that look ahead by what they are, the smaller of those at the two ends of an interval.
    """
    slope = jnp.diff(y, axis=0) / jnp.diff(time)[:, None]
    inner = jnp.diff(slope, axis=0) / (0.5 * (time[2:] - time[:-2]))[:, None]
    left = jnp.concatenate([jnp.zeros_like(slope[:1]), inner])
    other = jnp.concatenate([inner, jnp.zeros_like(slope[:1])] if ahead else [left[:2], left[1:-1]])
    smaller = jnp.where(jnp.abs(left) < jnp.abs(other), left, other)
    return jnp.where(left * other > 0.0, smaller, 0.0)
