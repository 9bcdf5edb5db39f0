"""Commands by which the motors would brake all the time: they are no voltages of theirs, and nothing would drive the robot."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._float64 import in_float64
from ...logs import LogSet
from ...robots.effect import Numbers, Scalars, State
from ...robots.robot import Robot

_NEARLY = 0.8
"""Share of the power of the motors at which it goes the wrong way: a robot that rolls downhill stands and climbs, too."""


def _power(robot: Robot, p: Numbers, state: State, inputs: Scalars) -> Float[Array, " axes"]:
    """The mechanical power of every drive axis, but for a factor that they share; of none where torques and speeds are not
    those of the same axes."""
    torques, speeds = robot.drive_torques(inputs, state, p), robot.angle_rates(state, p)
    if not torques or len(torques) != len(speeds):
        return jnp.zeros(0)
    return jnp.stack([torque * speed for torque, speed in zip(torques, speeds, strict=True)])


@in_float64
def braking_motors(robot: Robot, logs: LogSet) -> str:
    """A sentence on commands at which motors whose resistance and constants are known would take power from the motion nearly
    all the time; empty where they would drive it, and where the logs do not hold every velocity."""
    if not robot.winding or robot.controlled or not robot.velocities:
        return ""
    p, taken, turned_over = robot.parameters.numbers, 0.0, 0.0
    for log in logs:
        if not set(robot.velocities) <= set(log.measured):
            return ""
        state = {name: log.output(name) if name in robot.velocities else np.zeros(len(log)) for name in robot.states}
        inputs = tuple(log.input(name) for name in robot.channels.inputs)
        # A user's functions are of scalars: sample by sample.
        power = np.asarray(jax.vmap(partial(_power, robot, p))(state, inputs))
        taken -= float(np.nansum(power))
        turned_over += float(np.nansum(np.abs(power)))
    if not turned_over > 0.0 or not taken > _NEARLY * turned_over:
        return ""
    return (
        f"By the motors' known constants these commands would brake the robot nearly all the time it moves "
        f"({taken / turned_over:.0%} of the power goes from the motion into the motors), so that nothing would drive it: they "
        "are in another unit, they are set-points of a controller and not the motors' voltages, or the sign of a column is "
        "the other."
    )
