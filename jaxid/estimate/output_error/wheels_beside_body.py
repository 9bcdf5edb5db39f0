"""Wheels whose angles say many times as much motion as the body's own sensors: a unit, or a gear that was forgotten."""

import numpy as np
from numpy.typing import NDArray

from ...logs import Log, LogSet
from ...robots.robot import Robot
from ...simulation.reckoning import wheel_readout

Array = NDArray[np.float64]
_FACTOR = 2.5
"""Times as far as the sensors from which it is another unit: wheels that slip, or other radii, make less."""
_ALIKE = 0.9
"""Correlation from which both say one motion."""
_WINDOW = 0.5
"""Seconds over which motions are compared: noise of either counts for little, and a lag, too."""
_FEWEST = 10


def _moved(log: Log, matrix: Array, robot: Robot, name: str) -> tuple[Array, Array]:
    """How far one velocity took the robot in each window, by the wheels' angles and by its own sensor."""
    width = max(1, round(_WINDOW / log.sampling_interval))
    angles = np.stack([log.output(angle) for angle in robot.measured_angles], axis=1)
    speed = log.output(name)
    starts = np.arange(0, len(log) - width, width)
    steps = np.diff(log.time)
    by_sensor = np.concatenate([[0.0], np.cumsum(0.5 * steps * (speed[1:] + speed[:-1]))])
    by_wheels = (angles[starts + width] - angles[starts]) @ matrix[robot.velocities.index(name)]
    found = by_wheels, by_sensor[starts + width] - by_sensor[starts]
    there = np.isfinite(found[0]) & np.isfinite(found[1])
    return found[0][there], found[1][there]


def wheels_beside_body(robot: Robot, logs: LogSet) -> str:
    """A sentence on measured angles of the wheels that move the robot many times as far as a sensor of its velocity says, by
    the radii and places of the table; empty where they do not, and where only one of the two is measured."""
    if not robot.measured_angles or robot.controlled:
        return ""
    matrix = wheel_readout(robot)
    if matrix is None:
        return ""
    said = []
    for name in robot.velocities:
        both = (*robot.measured_angles, name)
        parts = [_moved(log, matrix, robot, name) for log in logs if all(one in log.measured for one in both)]
        if not parts:
            continue
        wheels, body = (np.concatenate(own) for own in zip(*parts, strict=True))
        product, size = float(wheels @ body), float(np.linalg.norm(wheels) * np.linalg.norm(body))
        if len(body) < _FEWEST or not abs(product) > _ALIKE * size > 0.0:
            continue
        factor = abs(product) / float(body @ body)
        if not 1.0 / _FACTOR < factor < _FACTOR:
            said.append((name, factor))
    if not said:
        return ""
    far = " and ".join(f"{factor:.3g} times as far as {name} says" for name, factor in said)
    return (
        f"By the wheels' radii and places their measured angles move the robot {far}: the angles are in another unit (counts a "
        f"turn, or a gear between the encoder and the wheel), {said[0][0]} is, or a length of the table."
    )
