"""Angles integrated from measured speeds against closed forms and the simulator."""

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, Pioneer
from jaxid.effects import effect_by_id
from jaxid.simulation.integrated_angles import integrated_angles

INPUTS = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5], 60)


def test_an_axis_is_where_its_measured_position_says(axis_log):
    robot = Axis() + effect_by_id(Axis(), "cogging_torque")
    noisy, long = axis_log("noisy", INPUTS, noise=0.01), axis_log("long", np.tile(INPUTS, 2), noise=0.0)
    angles = np.asarray(integrated_angles(robot, LogSet([noisy, long]))["q"])
    # The sum of 360 samples of noise: 0.01 m/s * 0.02 s * sqrt(360) = 4 mm; the measured position's own is 10 mm.
    np.testing.assert_allclose(angles[0, : len(noisy)], noisy.output("q"), atol=0.05)
    np.testing.assert_allclose(angles[1, : len(long)], long.output("q"), atol=0.02)


def test_missing_samples_are_bridged(axis_log):
    log = axis_log("gap", INPUTS, noise=0.0)
    v = log.output("v").copy()
    v[100:104] = np.nan
    broken = Log.from_arrays("gap", log.time, log.inputs, {"v": v, "q": log.output("q")}, log.channels)
    robot = Axis() + effect_by_id(Axis(), "cogging_torque")
    angles = np.asarray(integrated_angles(robot, LogSet([broken]))["q"])
    np.testing.assert_allclose(angles[0, : len(log)], log.output("q"), atol=0.03)


def test_wheels_of_a_pioneer_turn_as_rolling_says():
    """R phi' = eta1 +- L eta2: on the spot the wheels turn against each other, straight on alike."""
    robot = Pioneer()
    robot = robot + effect_by_id(robot, "cogging_torque")
    time = np.arange(101) * 0.02
    speed, rate = np.full(101, 0.5), np.full(101, 0.8)
    logs = LogSet(
        Log.from_arrays(name, time, np.zeros((101, 2)), {"eta1": eta1, "eta2": eta2}, robot.channels)
        for name, eta1, eta2 in (("straight", speed, 0 * rate), ("spot", 0 * speed, rate))
    )
    angles = {name: np.asarray(values)[:, 100] for name, values in integrated_angles(robot, logs).items()}
    R, L = robot.parameters["R"].value, robot.parameters["L"].value
    assert angles["phi2"][0] == pytest.approx(angles["phi3"][0]) and abs(angles["phi2"][0]) == pytest.approx(1.0 / R)
    assert angles["phi2"][1] == pytest.approx(-angles["phi3"][1]) and abs(angles["phi2"][1]) == pytest.approx(
        1.6 * L / R
    )


def test_nothing_for_a_robot_without_wheel_angles(axis_log):
    log = Log.from_arrays("log", np.arange(50) * 0.02, np.zeros((50, 2)), {n: np.zeros(50) for n in ("eta1", "eta2")},
                          Pioneer().channels)  # fmt: skip
    assert dict(integrated_angles(Pioneer(), LogSet([log]))) == {}
