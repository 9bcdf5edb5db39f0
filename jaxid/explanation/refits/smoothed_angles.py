"""Wheel angles as the logs show them, for models with an effect that repeats with them.

A torque ripple makes a wheel come to rest in one notch or the next. Which one hangs on less than the noise, and from there
on a free simulation runs beside the robot however right its model. So such a model is also judged with its wheels' angles
prescribed from measurements: smoothed from the measured speeds through the model itself, with missing forces that wander
only weakly, so that the angle is prescribed and not the motion, which is simulated as ever.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Array, Float

from ..._arrays import array
from ...logs import LogSet
from ...robots.robot import Robot
from ...simulation.integrated_angles import integrated_angles
from ..where.missing_force import NoVelocities, Smoothed, smoothed_states

WANDER = 0.035
"""Random-walk intensity of the missing forces, in units of `ForceHistory.scale` per root of its response time."""

Angles = Mapping[str, Float[Array, "E T"]]


def smoothed_ways(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float],
    known_states: Mapping[str, Mapping[str, float]],
    wander: float = WANDER,
) -> dict[str, Smoothed]:
    """The wheels' angles smoothed through `robot`, with their standard deviations; empty where that cannot be done.

    Empty, too, where no effect of the robot repeats with the wheels or a velocity was not measured. `known_states` are
    estimated initial states by log name; less `wander` of the missing forces trusts the model more.
    """
    names = integrated_angles(robot, logs)
    try:
        smooth = smoothed_states(robot, logs, noise, known_states, wander) if names else {}
    except NoVelocities:
        return {}
    found = {name: smooth[name] for name in names}
    return found if all(bool(np.isfinite(angle.mean).all()) for angle in found.values()) else {}


def smoothed_angles(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float],
    known_states: Mapping[str, Mapping[str, float]],
    wander: float = WANDER,
) -> Angles:
    """The means of `smoothed_ways`; from the speeds alone where they cannot be had."""
    smooth = smoothed_ways(robot, logs, noise, known_states, wander)
    return {name: array(own.mean) for name, own in smooth.items()} or integrated_angles(robot, logs)
