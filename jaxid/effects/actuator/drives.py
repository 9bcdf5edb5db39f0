"""What effects on commands and motors share; of a robot in closed loop the inputs are its plant's."""

from collections.abc import Callable

import jax.numpy as jnp

from ...robots.effect import Numbers, Scalar, Scalars
from ...robots.robot import Robot
from ..curve import Curve


def input_unit(robot: Robot) -> str:
    """Unit of the drive inputs."""
    channels = robot.alone.channels
    return channels.units.get(channels.inputs[0], "")


def drive_names(robot: Robot) -> list[str]:
    """Names of the inputs that drive."""
    return [robot.alone.channels.inputs[k] for k in robot.drive_inputs]


def other_inputs(robot: Robot) -> list[str]:
    """Names of the inputs that do not drive, such as a steering angle."""
    return [name for k, name in enumerate(robot.alone.channels.inputs) if k not in robot.drive_inputs]


def each_other_input(robot: Robot, value: Callable[[str], Scalar]):
    """`value(name)` of every input that does not drive, 0 of those that do, [nu]."""
    others = other_inputs(robot)
    return jnp.stack([jnp.asarray(value(n) if n in others else 0.0, float) for n in robot.channels.inputs])


def on_drives(robot: Robot, inputs, changed):
    """`changed` where an input drives, `inputs` elsewhere, both [T, nu]."""
    count = len(robot.channels.inputs)
    drives = jnp.array([i in robot.drive_inputs for i in range(count)])
    return changed if len(robot.drive_inputs) == count else jnp.where(drives, changed, inputs)


def each_drive(robot: Robot, value: Callable[[str], Scalar]):
    """`value(name)` of every input that drives, 0 of the others, [nu]."""
    names = enumerate(robot.channels.inputs)
    return jnp.stack([jnp.asarray(value(n) if i in robot.drive_inputs else 0.0, float) for i, n in names])


def lost_of_each(curve: Curve, size, p: Numbers, robot: Robot):
    """What a curve loses of commands of that `size` [T, nu], each by its motor's own where the curves are apart."""
    if not curve.apart:
        return curve.at(size, p)
    names = enumerate(robot.channels.inputs)
    lost = [curve.at(size[..., i], p, n) if i in robot.drive_inputs else jnp.zeros_like(size[..., i]) for i, n in names]
    return jnp.stack(lost, axis=-1)


def back_emf(volts: Scalars, currents: Scalars, k: int, p: Numbers, robot: Robot) -> Scalar:
    """Back-EMF [V] of motor `k`: what of its voltage is not lost in the winding."""
    return volts[k] - p[robot.winding] * currents[k]


def one_torque_each(robot: Robot) -> bool:
    """Whether every drive input has a drive torque of its own, in the same order."""
    zero = dict.fromkeys(robot.states, 0.0) | robot.initial_state()
    idle = (0.0,) * len(robot.channels.inputs)
    return len(robot.drive_torques(idle, zero, robot.parameters.numbers)) == len(robot.drive_inputs)


def torque_falls_with_speed(robot: Robot) -> bool:
    """Whether the drive torques without a command are others in motion than at rest, as a back-EMF makes them."""
    idle, rest = (0.0,) * len(robot.channels.inputs), dict.fromkeys(robot.states, 0.0) | robot.initial_state()
    moving = rest | dict.fromkeys(robot.velocities, 1.0)
    still, driven = (robot.drive_torques(idle, state, robot.parameters.numbers) for state in (rest, moving))
    return any(float(one) != float(other) for one, other in zip(still, driven, strict=True))
