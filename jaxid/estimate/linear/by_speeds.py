"""Speeds for the linear methods, whose equations are balances of momentum, from measured angles of wheels.

What an estimate by differentiated positions is good for is to start from: noise of a position becomes noise of the speeds
that is related from sample to sample and stands on both sides of the equations. Output error takes the positions as they are.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ...logs import Log, LogSet
from ...robots.given import given_logs
from ...robots.robot import Robot
from ...simulation.reckoning import measured_velocities


def _spoken(robot: Robot, log: Log, plain: Robot) -> Log:
    """The log of the `plain` robot, which measures speeds: those that were not measured are central differences."""
    found = measured_velocities(robot, log)
    there = set(log.measured)
    columns = [log.output(n) if n in there else found.get(n, log.output(n)) for n in plain.channels.measured]
    return replace(log, outputs=np.stack(columns, axis=1), channels=plain.channels)


def by_speeds(robot: Robot, logs: Iterable[Log]) -> tuple[Robot, LogSet]:
    """The robot without measured angles of wheels, and its logs with the speeds that follow from these.

    Raises `LogError` for logs of another robot, and for wheels that do not tell the speeds.
    """
    logs = given_logs(robot, logs)
    if not robot.measured_angles:
        return robot, logs
    plain = replace(robot, wheel_angles=False)
    return plain, LogSet(_spoken(robot, log, plain) for log in logs)
