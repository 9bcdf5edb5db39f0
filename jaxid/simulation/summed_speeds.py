"""Speeds that are differences of encoders' counts, and the positions that they add up to.

A speed that a program makes of two counts has the rounding of both in it, with opposite signs: its noise is related from row
to row, and a controller that answers it writes that noise into the next command. Added up again, such speeds are the counts
themselves, whose rounding is white and late by nothing.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._float64 import in_float64
from ..logs import Log, LogSet
from ..logs.counts import added_up
from ..robots.robot import Robot
from ..robots.wheel_angles import measuring_angles
from .reckoning import angle_rates_of

Array = NDArray[np.float64]
_ALIKE = 1.1
"""Ratio up to which steps are those of the same encoders."""


class _Positions(NamedTuple):
    """A robot that measures positions `names` in the place of its speeds, and the `weights` [positions, outputs] that make the
    rates of these of the speeds."""

    robot: Robot
    names: tuple[str, ...]
    weights: Array


def _per_second(unit: str) -> str:
    return " or ".join(f"{one}/s" for one in unit.split(" or "))


@in_float64
def _positions(robot: Robot) -> _Positions | None:
    """The positions of what a robot's speeds are measured of, or the angles of its wheels; None where it measures neither, and
    in a loop, whose controller may answer the speeds themselves."""
    if robot.controlled:
        return None
    measuring, outputs = measuring_angles(robot), robot.channels.outputs
    units = measuring.channels.units
    own = {name: measuring.channels.stand_ins(name) for name in outputs}
    if all(len(names) == 1 and _per_second(units.get(names[0], "")) == units.get(name) for name, names in own.items()):
        return _Positions(measuring, tuple(names[0] for names in own.values()), np.eye(len(outputs)))
    if measuring is robot or measuring.measured_angles != robot.angles or not robot.velocities:
        return None
    weights = angle_rates_of(robot)
    return _Positions(measuring, robot.angles, weights) if np.isfinite(weights).all() else None


class Summed(NamedTuple):
    """Logs with positions in the place of speeds, the robot that measures these, and the step of each position's counter."""

    robot: Robot
    logs: LogSet
    steps: dict[str, float]


def as_positions(robot: Robot, logs: LogSet) -> Summed | None:
    """The logs with the positions that their speeds add up to, where all speeds of all logs are differences of counts; else
    None."""
    asked = _positions(robot)
    if asked is None:
        return None
    found, steps = [], dict.fromkeys(asked.names, 0.0)
    for log in logs:
        speeds = np.stack([log.output(name) for name in robot.channels.outputs], axis=1)
        if not np.isfinite(speeds).all() or any(name in log.measured for name in asked.names):
            return None
        ways = [added_up(own, log.time) for own in (speeds @ asked.weights.T).T]
        # Wheels have the same encoders: steps that differ are of a sum in which two of them are mixed, as by a wrong track.
        if not max(step for _, step in ways) < _ALIKE * min(step for _, step in ways):
            return None
        steps = {name: max(steps[name], step) for name, (_, step) in zip(asked.names, ways, strict=True)}
        found.append(_with(log, asked, [way for way, _ in ways]))
    return Summed(asked.robot, LogSet(found), steps)


def _with(log: Log, asked: _Positions, ways: list[Array]) -> Log:
    """The log with the positions `ways` [T] and without the speeds that they were made of."""
    kept = {name: log.output(name) for name in log.measured if name not in log.channels.outputs}
    outputs = {**kept, **dict(zip(asked.names, ways, strict=True))}
    channels, absent = asked.robot.channels, np.full(len(log), np.nan)
    every = np.stack([outputs.get(name, absent) for name in channels.measured], axis=1)
    return replace(log, outputs=every, channels=channels)


def in_a_mapping(robot: Robot) -> str:
    """The lines of a mapping that make a robot's positions of its measured speeds; empty where it has none."""
    asked = _positions(robot)
    lines = []
    for name, own in zip(asked.names, asked.weights, strict=True) if asked else ():
        weighted = zip(robot.channels.outputs, own, strict=True)
        fields = ", ".join(f"{speed} = {weight:.7g}" for speed, weight in weighted if weight)
        lines.append(f"{name} = {{ fields = {{ {fields} }}, integral = true }}")
    return " and ".join(lines)
