"""What effects on sensors share: they act on the measured outputs; optional channels (currents, position) keep out of it."""

import jax.numpy as jnp

from ...robots.effect import Effect, Numbers
from ...robots.robot import Robot


def each_output(effect: Effect, p: Numbers, stem: str, robot: Robot):
    """The effect's parameter `stem_NAME` of every output, 0 of optional channels, [ny]."""
    names = robot.channels.outputs
    absent = len(robot.channels.measured) - len(names)
    values = [jnp.asarray(p[effect.key(f"{stem}_{name}")], float) for name in names]
    return jnp.stack([*values, *([jnp.zeros(())] * absent)])


def outputs_only(robot: Robot, changed, outputs):
    """`changed` for the outputs, `outputs` for the optional channels, both [T, ny]."""
    n = len(robot.channels.outputs)
    return jnp.concatenate([changed[:, :n], outputs[:, n:]], axis=1)


def bends(y, time):
    """Second derivative of y [T, ny] within each interval [T - 1, ny]: the smaller of those at its two ends.

    Inputs change at samples and put kinks there; those belong to no interval.
    """
    slope = jnp.diff(y, axis=0) / jnp.diff(time)[:, None]
    inner = jnp.diff(slope, axis=0) / (0.5 * (time[2:] - time[:-2]))[:, None]
    left = jnp.concatenate([jnp.zeros_like(slope[:1]), inner])
    right = jnp.concatenate([inner, jnp.zeros_like(slope[:1])])
    smaller = jnp.where(jnp.abs(left) < jnp.abs(right), left, right)
    return jnp.where(left * right > 0.0, smaller, 0.0)
