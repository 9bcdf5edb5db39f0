"""Commanded voltages that the robot's supply cannot give: they are in another unit, or the supply is another."""

import numpy as np

from ...logs import LogSet
from ...robots.robot import Robot

_BEYOND = 1.1
"""Times the supply's voltage that a full battery has, and a recorder rounds to."""
_SHARE = 0.01
"""Of a log set's commands that may be spikes."""


def beyond_supply(robot: Robot, logs: LogSet) -> str:
    """A sentence on inputs in volts, of which many are beyond the voltage of the robot's supply; empty where none are."""
    supply = robot.supply_voltage
    volts = robot.parameters[supply].value if isinstance(supply, str) else supply
    if not volts or not volts > 0:
        return ""
    found = {}
    for name in (name for name in robot.channels.inputs if robot.channels.units.get(name) == "V"):
        size = np.abs(np.concatenate([log.input(name) for log in logs]))
        share = float(np.mean(size > _BEYOND * volts))
        if share > _SHARE:
            found[name] = share, float(np.quantile(size, 0.99))
    if not found:
        return ""
    share, largest = max(found.values())
    which = f" ({supply})" if isinstance(supply, str) else ""
    return (
        f"{' and '.join(found)}: {share:.0%} of the commands are beyond the {volts:.4g} V of the supply{which}, up to "
        f"{largest:.3g} V; if they are in percent or another unit, map the column with the scale that gives volts, else "
        "correct the supply."
    )
