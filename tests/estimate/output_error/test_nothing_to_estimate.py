"""Integral least squares on logs that contradict their inputs: a result that says so, no traceback."""

import numpy as np
import pytest

from jaxid import (
    Channels,
    Custom,
    Log,
    LogError,
    LogSet,
    Omni,
    Parameter,
    Pioneer,
    integral_least_squares,
    output_error,
)


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


def test_a_parameter_that_next_to_nothing_shows_is_not_identified():
    """It would have to be 1e18 to change the simulation: that its error is a little less says nothing of it."""
    channels = Channels(("u",), ("v",), units={"u": "N", "v": "m/s"})
    robot = Custom(
        dynamics=lambda x, u, p: {"v": u["u"] / p["M"] - p["d"] * x["v"] + 1e-18 * p["faint"] * x["v"] ** 2},
        state_names=("v",),
        own_channels=channels,
        table={name: Parameter(1.0, free=True) for name in ("M", "d", "faint")},
    )
    rng = np.random.default_rng(6)
    u, v = np.repeat(rng.uniform(-3.0, 3.0, 30), 20), np.zeros(600)
    for k in range(599):
        v[k + 1] = v[k] * np.exp(-0.03) + u[k] / 2.0 / 1.5 * (1.0 - np.exp(-0.03))
    log = Log.from_arrays("a", 0.02 * np.arange(600), u, v + 0.01 * rng.normal(size=600), channels)
    fit = output_error(robot, LogSet([log]))
    assert fit["faint"].status == "not_identifiable" and fit["faint"].std_error > 1e12
    assert fit["M"].value == pytest.approx(2.0, abs=4 * fit["M"].std_error) and fit["M"].status == "identified"
