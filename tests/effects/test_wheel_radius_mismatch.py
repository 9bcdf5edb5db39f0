"""Wheels of other radii: the law of each wheel against the omni's own radius, and that of its sides."""

import numpy as np
import pytest

from jaxid import DifferentialDrive, EffectError, Log, LogSet, Omni, Pioneer, Wheel, Wheeled, output_error, simulate
from jaxid.effects import effect_by_id, laws_of
from jaxid.effects.ground.wheel_radius_mismatch import RadiusOfEach, WithTheirMean
from jaxid.simulation.rollout import Integrator


def driven(robot):
    rng, n = np.random.default_rng(4), 200
    inputs = np.repeat(rng.uniform(-6.0, 6.0, (n // 20, 4)), 20, axis=0)
    logs = LogSet([Log.from_arrays("one", 0.02 * np.arange(n), inputs, np.zeros((n, 3)), robot)])
    return simulate(robot, logs, integrator=Integrator(4))[0]


def with_radii(*mismatches):
    robot = Omni() + effect_by_id(Omni(), "wheel_radius_mismatch", "each_wheel")
    names = [name for name in robot.parameters if name.startswith("wheel_radius_mismatch.")]
    return robot.with_values(**dict(zip(names, mismatches, strict=True)))


def test_all_wheels_larger_are_the_robot_with_larger_wheels():
    larger = Omni().with_values(r=1.05 * Omni().parameters["r"].value)
    np.testing.assert_allclose(driven(with_radii(*[0.05] * 4)), driven(larger), rtol=1e-9, atol=1e-12)
    assert np.max(np.abs(driven(larger) - driven(Omni()))) > 1e-3


def test_wheels_larger_on_one_side_are_the_robot_with_the_sides_own_mismatch():
    sides = driven(Omni().with_values(radius_mismatch=0.04))
    np.testing.assert_allclose(driven(with_radii(0.04, 0.04, -0.04, -0.04)), sides, rtol=1e-9, atol=1e-12)


def test_one_wheel_is_told_as_one_of_another_torque_constant_is():
    """R (1 + m) is Kt / (1 + m), and Kv alike: no log of the body's motion tells the two apart."""
    robot = Omni() + effect_by_id(Omni(), "motor_gain_mismatch", "torque_constant")
    third = [name for name in robot.parameters if name.startswith("motor_gain_mismatch.")][2]
    stronger = driven(robot.with_values(**{third: 1.0 / 0.97 - 1.0}))
    np.testing.assert_allclose(driven(with_radii(0.0, 0.0, -0.03, 0.0)), stronger, rtol=1e-9, atol=1e-12)


def test_a_robot_with_two_wheels_has_the_law_of_its_sides():
    assert [law.law for law in laws_of(Pioneer(), "wheel_radius_mismatch")] == ["", "with_their_mean"]
    with pytest.raises(EffectError, match="drives two wheels or fewer"):
        Pioneer() + RadiusOfEach()


def test_where_wheels_are_measured_their_radii_are_the_robots_own():
    """An encoder turns by as much more as its wheel is smaller, which a law of forces alone knows nothing of."""
    with pytest.raises(EffectError, match="how fast its wheels turn"):
        Omni(wheel_angles=True) + RadiusOfEach()
    assert [law.law for law in laws_of(Omni(wheel_angles=True), "wheel_radius_mismatch")] == ["", "with_their_mean"]
    assert [law.law for law in laws_of(Omni(pose=True), "wheel_radius_mismatch")] == [
        "",
        "with_their_mean",
        "each_wheel",
    ]


def test_a_wheel_that_is_larger_alone_makes_their_mean_larger_too():
    """The law of the sides keeps the table's mean, and the robot's friction takes up what that is off."""
    robot = Pioneer() + effect_by_id(Pioneer(), "wheel_radius_mismatch", "with_their_mean")
    assert {"R", "radius_mismatch"} <= set(robot.parameters.free_names)
    assert "R" not in Pioneer().parameters.free_names
    with pytest.raises(EffectError, match="no parameter that is its wheels' radius"):
        DifferentialDrive() + WithTheirMean()


def test_either_wheel_alone_may_be_off_where_no_free_number_is_their_radius():
    """With the mean that makes one wheel the table's, the other is larger by all of the difference."""
    effect = effect_by_id(DifferentialDrive(), "wheel_radius_mismatch")
    robot = (DifferentialDrive() + effect).with_values(radius_mismatch=0.04)
    other = effect.conventions(robot)
    assert list(other) == ["the right wheel is as the table says", "the left wheel is as the table says"]
    gain = robot.parameters["gain"].value
    assert other["the left wheel is as the table says"]["gain"] == pytest.approx(gain * 0.96)
    assert other["the right wheel is as the table says"]["gain"] == pytest.approx(gain * 1.04)
    pioneer = Pioneer().with_values(radius_mismatch=0.04)
    other, radius = effect.conventions(pioneer), pioneer.parameters["R"].value
    assert other["the left wheel is as the table says"] == {"R": pytest.approx(radius / 0.96)}
    with_their_mean = pioneer + effect_by_id(pioneer, "wheel_radius_mismatch", "with_their_mean")
    assert effect.conventions(with_their_mean) == {}  # R is free, and says it


WORN = (0.0, -0.03, 0.01, 0.0)
PLACES = {"fl": (0.07, 0.05, 142.5), "bl": (-0.06, 0.06, 225.0), "br": (-0.06, -0.06, 315.0), "fr": (0.07, -0.05, 37.5)}


def worn():
    """An omni by its layout, whose wheels are measured, with four radii."""
    wheels = [Wheel(n, (x, y), kind="omni", rolls=way) for n, (x, y, way) in PLACES.items()]
    robot = Wheeled(wheels=tuple(wheels), measures="wheels", gyro=True, motors=False)
    none = {"viscous": 0.0, "coulomb": 0.0, "r": 0.03, "M": 2.0, "gain": 1.0}
    robot = robot + effect_by_id(robot, "wheel_radius_mismatch", "each_radius")
    names = [f"mismatch_{name}" for name in PLACES]
    assert all(robot.parameters[name].free for name in names)
    return robot.with_values(**none, **dict(zip(names, WORN, strict=True)))


def test_every_wheel_turns_and_pushes_as_its_own_radius_has_it():
    """How fast its place goes the way it rolls, over its radius; and a torque over its radius, that way."""
    robot, (V, Vn, W) = worn(), (0.7, -0.4, 1.1)
    state = {**robot.initial_state(), "V": V, "Vn": Vn, "W": W}
    seen = robot.observe(state, (0.0,) * 4, robot.parameters.numbers)
    for i, (x, y, way) in enumerate(PLACES.values()):
        radius, along = 0.03 * (1.0 + WORN[i]), (np.cos(np.radians(way)), np.sin(np.radians(way)))
        assert float(seen[i]) == pytest.approx((along[0] * (V - W * y) + along[1] * (Vn + W * x)) / radius)
        torques = [0.05 * (k == i) for k in range(4)]
        rates = robot.rates(robot.initial_state(), torques, (0.0,) * 4, robot.parameters.numbers)
        assert float(rates["V"]) == pytest.approx(0.05 / radius * along[0] / 2.0)
        assert float(rates["Vn"]) == pytest.approx(0.05 / radius * along[1] / 2.0)


def test_a_worn_wheel_of_four_is_found_by_its_encoder():
    """Logs of a base that nothing brakes, by Newton's law in small steps: the wheels turn by their own radii."""
    robot, random, logs = worn(), np.random.default_rng(2), []
    rows = np.array([[np.cos(a), np.sin(a), x * np.sin(a) - y * np.cos(a)] for x, y, a in
                     ((x, y, np.radians(way)) for x, y, way in PLACES.values())])  # fmt: skip
    radii = 0.03 * (1.0 + np.array(WORN))
    inertia = np.diag([2.0, 2.0, 0.3])
    for k in range(3):
        motion, speeds = np.zeros(3), []
        torques = np.repeat(random.uniform(-0.02, 0.02, (16, 4)), 25, axis=0)
        for torque in torques:
            speeds.append([*(rows @ motion / radii), motion[2]])
            for _ in range(40):  # in the body's axes, which turn
                V, Vn, W = motion
                pushed = np.linalg.solve(inertia, rows.T @ (torque / radii))
                motion = motion + 0.02 / 40 * (pushed + np.array([W * Vn, -W * V, 0.0]))
        seen = np.array(speeds) + random.normal(size=(400, 5)) * [0.02, 0.02, 0.02, 0.02, 0.002]
        logs.append(Log.from_arrays(f"{k}", 0.02 * np.arange(400), torques, seen, robot))
    start = robot.with_values(**dict.fromkeys((f"mismatch_{name}" for name in PLACES), 0.0))
    for name in ("viscous", "coulomb"):
        start = start.change(name, free=False)
    fit = output_error(start, LogSet(logs))
    for name, true in zip(PLACES, WORN, strict=True):
        own = fit[f"mismatch_{name}"]
        assert abs(own.value - true) < 4.0 * own.std_error < 0.004, name
