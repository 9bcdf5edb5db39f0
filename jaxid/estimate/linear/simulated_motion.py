"""The motion that an estimate makes of the logs' inputs, where it is one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...logs import Log, LogSet
from ...robots.robot import Robot
from ...simulation.simulate import integrator_for, simulate

Array = NDArray[np.float64]
_ASTRAY = 1e3
"""Simulated over measured magnitude from which a simulation has run away."""


def followed_simulation(robot: Robot, logs: LogSet) -> list[Array] | None:
    """Simulated outputs [T, channels.measured] of each log, None where they run away."""
    outputs = simulate(robot, logs, integrator=integrator_for(robot, logs))
    fine = all(_follows(y, log) for y, log in zip(outputs, logs, strict=True))
    return outputs if fine else None


def _follows(simulated: Array, log: Log) -> bool:
    """Each channel against its own measurement: magnitudes of different channels say nothing of one another."""
    if not np.isfinite(simulated).all():
        return False
    measured = np.isfinite(log.outputs).any(axis=0)
    largest = np.nanmax(np.abs(log.outputs[:, measured]), axis=0)
    return bool(np.all((np.abs(simulated[:, measured]).max(axis=0) <= _ASTRAY * largest) | (largest == 0)))


def twins_of(logs: LogSet, simulated: Sequence[Array]) -> LogSet:
    """The logs with the simulated outputs where there were measured ones."""
    return LogSet(
        replace(log, outputs=np.where(np.isfinite(log.outputs), outputs, np.nan))
        for log, outputs in zip(logs, simulated, strict=True)
    )
