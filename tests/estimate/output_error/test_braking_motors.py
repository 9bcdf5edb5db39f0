"""jaxid/estimate/output_error/braking_motors.py: commands that would brake all the time are no voltages of the motors."""

from dataclasses import replace
from pathlib import Path

import pytest

from jaxid import DifferentialDrive, LogSet, Omni, Pioneer, read_logs
from jaxid.estimate.output_error.braking_motors import braking_motors

DEMO = Path(__file__).parents[3] / "jaxid/demo_logs"


@pytest.mark.parametrize("robot", [Pioneer(), Omni()], ids=lambda robot: robot.name)
def test_set_points_of_a_speed_controller_are_no_voltages(robot):
    """The same motion by commands that are set-points in m/s, some hundredths of the volts that made it."""
    logs = read_logs(sorted((DEMO / robot.name).glob("fit_*.csv"))[:3], robot)
    assert braking_motors(robot, logs) == ""
    weak = LogSet([replace(log, inputs=0.02 * log.inputs) for log in logs])
    said = braking_motors(robot, weak)
    assert "set-points of a controller" in said and "100% of the power" in said


def test_of_motors_whose_resistance_is_not_known_nothing_is_said(axis_log):
    logs = read_logs(sorted((DEMO / "pioneer").glob("fit_*.csv"))[:1], Pioneer())
    other = DifferentialDrive()
    own = LogSet(
        [replace(log, inputs=0.02 * log.inputs, channels=replace(other.channels, outputs=("v", "w"))) for log in logs]
    )
    assert braking_motors(other, own) == ""
