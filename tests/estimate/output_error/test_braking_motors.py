"""jaxid/estimate/output_error/braking_motors.py: commands that would brake all the time are no voltages of the motors."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from jax import lax

from jaxid import (
    Channels,
    Custom,
    DifferentialDrive,
    DriveAxis,
    Log,
    LogSet,
    Omni,
    Parameter,
    ParameterTable,
    Pioneer,
    read_logs,
)
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


def test_functions_of_scalars_are_asked_sample_by_sample():
    """A torque that JAX chooses by a condition, which takes one number and no column of them."""

    def current(s, u, p):
        return {"u": lax.cond(u["u"] == 0.0, lambda: 0.0, lambda: (u["u"] - 5.0 * s["v"]) / p["R"])}

    robot = Custom(
        dynamics=lambda s, u, p: {"v": current(s, u, p)["u"] - s["v"]},
        state_names=("v",),
        own_channels=Channels(inputs=("u",), outputs=("v",), units={"u": "V", "v": "m/s"}),
        table=ParameterTable({"R": Parameter(2.0, "ohm", free=True)}),
        axes={"wheel": DriveAxis(speed="v", torque=lambda s, u, p: current(s, u, p)["u"], angle="phi")},
        forces={"v": 1.0},
        motor_currents=current,
        winding="R",
    )
    u, v = np.repeat([0.2, 0.0, -0.2], 40), np.repeat([0.6, 0.0, -0.6], 40)
    weak, strong = (
        LogSet([Log.from_arrays("run", 0.02 * np.arange(120), times * u[:, None], {"v": v}, robot.channels)])
        for times in (1.0, 40.0)
    )
    assert "set-points of a controller" in braking_motors(robot, weak) and braking_motors(robot, strong) == ""


def test_of_motors_whose_resistance_is_not_known_nothing_is_said(axis_log):
    logs = read_logs(sorted((DEMO / "pioneer").glob("fit_*.csv"))[:1], Pioneer())
    other = DifferentialDrive()
    own = LogSet(
        [replace(log, inputs=0.02 * log.inputs, channels=replace(other.channels, outputs=("v", "w"))) for log in logs]
    )
    assert braking_motors(other, own) == ""
