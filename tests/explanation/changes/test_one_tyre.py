"""A tyre that lost air, on a drive whose model has no radius: by the small steps of a simulator of its own."""

import numpy as np
import pytest

from jaxid import DifferentialDrive, Log, LogSet, Omni, Pioneer, explain_change, output_error

DT, FINE, SAMPLES = 0.02, 20, 500
MASS, LEVER, FV, FC, GAIN = 9.0, 0.2, 4.1, 1.7, 3.0


def side(u, radius):
    """Speeds [T] of one side of a drive whose sides do not feel each other (J = M b²), its wheel so many times the nominal one:
    torques of motor, viscous and dry friction push at the rim."""
    v, found, h, mass = 0.0, [], DT / FINE, 0.5 * MASS
    for command in u:
        found.append(v)
        for _ in range(FINE):
            free = mass * v + h * GAIN * command / radius
            v = np.sign(free) * max(abs(free) - h * FC / radius, 0.0) / (mass + h * FV / radius**2)
    return np.array(found)


def recorded(seed, radius):
    logs = []
    for k in range(4):
        rng = np.random.default_rng([seed, k])
        u = np.repeat(rng.uniform(-3.0, 3.0, (SAMPLES // 20, 2)), 20, axis=0)
        right, left = side(u[:, 0], radius), side(u[:, 1], 1.0)
        v = 0.5 * (right + left) + 0.008 * rng.normal(size=SAMPLES)
        w = (right - left) / (2 * LEVER) + 0.015 * rng.normal(size=SAMPLES)
        logs.append(
            Log.from_arrays(
                f"run {seed}.{k}", DT * np.arange(SAMPLES), u, {"v": v, "w": w}, DifferentialDrive().channels
            )
        )
    return LogSet(logs)


@pytest.mark.slow
def test_a_smaller_tyre_of_one_side_is_no_payload():
    before, after = recorded(1, 1.0), recorded(2, 0.97)
    robot = DifferentialDrive().with_values(M=8.0, J=0.3, Fv=4.0, Fc=1.5, b=LEVER, gain=GAIN)
    found = explain_change(output_error(robot, before), output_error(robot, after), before, after)
    assert found.verdict == "named" and found.change.id == "radius_of_right_wheel", found.sentence
    (size,) = (own.size for own in found.change.differences.values())
    assert size.value == pytest.approx(-0.03, abs=4 * size.std_error) and size.std_error < 0.003


@pytest.mark.parametrize("robot", [Pioneer(), Omni()])
def test_of_a_robot_with_a_radius_all_wheels_larger_are_another_radius(robot):
    (name,) = robot.with_larger_wheels(robot.parameters.numbers, 0.1)
    assert name == robot.wheel_radius
    assert robot.with_larger_wheels({name: 0.1}, 0.1)[name] == pytest.approx(0.11)
