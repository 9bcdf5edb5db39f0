"""Wheels whose angles or speeds say many times as much motion as the body does by its sensors: a unit, or a forgotten gear."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...logs import Log, LogSet
from ...robots.robot import Robot
from ...simulation.reckoning import readout_of, wheel_readout

Array = NDArray[np.float64]
_FACTOR = 2.5
"""Times as far as the sensors from which it is another unit: wheels that slip, or other radii, make less."""
_SKIDDING = 4.0
"""The same of wheels that skid as the robot turns, which goes round by a third of what they say."""
_ALIKE = 0.9
"""Correlation from which both say one motion."""
_WINDOW = 0.5
"""Seconds over which motions are compared: noise of either counts for little, and a lag, too."""
_FEWEST = 10


def _moved(log: Log, columns: Sequence[str], rates: bool, row: Array, name: str) -> tuple[Array, Array]:
    """How far one velocity took the robot in each window, by the wheels' angles or `rates` in `columns`, of which it is `row`
    times as much, and by its own sensor."""
    width = max(1, round(_WINDOW / log.sampling_interval))
    starts = np.arange(0, len(log) - width, width)
    steps = np.diff(log.time)

    def integrated(values: Array) -> Array:
        """Over each window; not a number where it holds an empty cell."""
        pieces = 0.5 * steps * (values[1:] + values[:-1])
        return np.array([pieces[a : a + width].sum() for a in starts])

    each = [log.output(column) for column in columns]
    turned = [integrated(own) if rates else own[starts + width] - own[starts] for own in each]
    found = np.stack(turned, axis=1) @ row, integrated(log.output(name))
    there = np.isfinite(found[0]) & np.isfinite(found[1])
    return found[0][there], found[1][there]


def wheels_beside_body(robot: Robot, logs: LogSet) -> str:
    """A sentence on measured angles or speeds of the wheels that move the robot many times as far as a sensor of its velocity
    says, by the radii and places of the table; empty where they do not, and where only one of the two is measured."""
    if robot.controlled:
        return ""
    rates = tuple(name for name in robot.channels.outputs if name not in robot.velocities)
    of_angles = wheel_readout(robot) if robot.measured_angles else None
    return _beside(robot, logs, robot.measured_angles, False, of_angles) or _beside(
        robot, logs, rates, True, readout_of(robot, rates)
    )


def _beside(robot: Robot, logs: LogSet, columns: tuple[str, ...], rates: bool, matrix: Array | None) -> str:
    if matrix is None:
        return ""
    said = []
    for name in robot.velocities:
        most = _SKIDDING if robot.scrubs and name == robot.turning else _FACTOR
        row = matrix[robot.velocities.index(name)]
        parts = [
            _moved(log, columns, rates, row, name)
            for log in logs
            if all(one in log.measured for one in (*columns, name))
        ]
        if not parts:
            continue
        wheels, body = (np.concatenate(own) for own in zip(*parts, strict=True))
        product, size = float(wheels @ body), float(np.linalg.norm(wheels) * np.linalg.norm(body))
        if len(body) < _FEWEST or not abs(product) > _ALIKE * size > 0.0:
            continue
        factor = abs(product) / float(body @ body)
        if not 1.0 / most < factor < most:
            said.append((name, factor))
    if not said:
        return ""
    far = " and ".join(f"{factor:.3g} times as far as {name} says" for name, factor in said)
    what = "speeds" if rates else "angles"
    unit = "revolutions a minute are 9.55 times rad/s" if rates else "counts a turn"
    return (
        f"By the wheels' radii and places their measured {what} move the robot {far}: the {what} are in another unit ({unit}, "
        f"or a gear between the encoder and the wheel), {said[0][0]} is, or a length of the table."
    )
