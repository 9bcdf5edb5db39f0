"""Integral least squares on logs that determine nothing: a result that says so, no traceback."""

import numpy as np
import pytest

from jaxid import Log, LogSet, Omni, Pioneer, integral_least_squares


@pytest.mark.parametrize("robot", [Omni(), Pioneer()])
def test_a_robot_that_never_moved_identifies_nothing(robot):
    inputs, outputs = len(robot.channels.inputs), len(robot.channels.outputs)
    time = np.arange(300) * 0.02
    log = Log.from_arrays("still", time, np.zeros((300, inputs)), np.zeros((300, outputs)), robot.channels)
    fit = integral_least_squares(robot, LogSet([log]))
    assert {fit[name].status for name in fit.free_names} == {"not_identifiable"}
