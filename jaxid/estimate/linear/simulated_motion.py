"""The motion that an estimate makes of the logs' inputs, where it is one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ...robots.robot import Robot
from ...simulation.simulate import integrator_for, simulate

Array = NDArray[np.float64]
_ASTRAY = 1e3
"""Simulated over measured magnitude from which a simulation has run away."""


def followed_simulation(robot: Robot, logs: LogSet) -> list[Array] | None:
    """Simulated outputs [T, channels.measured] of each log, None where they run away."""
    outputs = simulate(robot, logs, integrator=integrator_for(robot, logs))
    speeds = [np.nanmax(np.abs(log.outputs)) for log in logs]
    fine = all(
        np.isfinite(y).all() and np.abs(y).max() <= _ASTRAY * most for y, most in zip(outputs, speeds, strict=True)
    )
    return outputs if fine else None


def twins_of(logs: LogSet, simulated: Sequence[Array]) -> LogSet:
    """The logs with the simulated outputs where there were measured ones."""
    return LogSet(
        replace(log, outputs=np.where(np.isfinite(log.outputs), outputs, np.nan))
        for log, outputs in zip(logs, simulated, strict=True)
    )
