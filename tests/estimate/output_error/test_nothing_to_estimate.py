"""Integral least squares on logs that contradict their inputs: a result that says so, no traceback."""

import numpy as np
import pytest

from jaxid import Log, LogError, LogSet, Omni, Pioneer, integral_least_squares


def altered(demo_logs, robot, name, change):
    log = next(log for log in demo_logs(robot) if log.name == name)
    return LogSet([Log.from_arrays(log.name, log.time, change(log.inputs), log.outputs, log.channels)])


def test_motion_without_any_input_leaves_something_open(demo_logs):
    fit = integral_least_squares(Omni(), altered(demo_logs, "omni", "fit_steps.csv", lambda u: 0.0 * u))
    assert {"not_identifiable", "at_bound"} & {fit[name].status for name in fit.free_names}


def test_a_swapped_sign_of_one_wheel_gives_a_result_that_says_so(demo_logs):
    logs = altered(demo_logs, "pioneer", "fit_prbs_forward.csv", lambda u: u * [-1.0, 1.0])
    fit = integral_least_squares(Pioneer(), logs)
    assert {"not_identifiable", "at_bound"} & {fit[name].status for name in fit.free_names}
    assert any(finding.severity in ("warning", "error") for finding in logs.preflight())


@pytest.mark.parametrize("robot", [Omni(), Pioneer()])
def test_a_robot_that_never_moved_is_an_error(robot):
    inputs, outputs = len(robot.channels.inputs), len(robot.channels.outputs)
    time = np.arange(300) * 0.02
    log = Log.from_arrays("still", time, np.zeros((300, inputs)), np.zeros((300, outputs)), robot.channels)
    with pytest.raises(LogError):
        integral_least_squares(robot, LogSet([log]))
