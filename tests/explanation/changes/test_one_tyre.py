"""A tyre that lost air, on a drive whose model has no radius: by the small steps of a simulator of its own."""

import numpy as np
import pytest

from jaxid import DifferentialDrive, Log, LogSet, Omni, Pioneer, explain_change, output_error
from jaxid.explanation.changes.candidates import candidates_of

DT, FINE, SAMPLES = 0.02, 20, 500
MASS, LEVER, FV, FC, GAIN = 9.0, 0.2, 4.1, 1.7, 3.0


def side(u, radius, torque=1.0, dry=FC):
    """Speeds [T] of one side of a drive whose sides do not feel each other (J = M b²), its wheel so many times the nominal one:
    torques of motor, viscous and dry friction push at the rim. `torque`: what its worn gear leaves of the motor's."""
    v, found, h, mass = 0.0, [], DT / FINE, 0.5 * MASS
    for command in u:
        found.append(v)
        for _ in range(FINE):
            free = mass * v + h * torque * GAIN * command / radius
            v = np.sign(free) * max(abs(free) - h * dry / radius, 0.0) / (mass + h * FV / radius**2)
    return np.array(found)


def recorded(seed, radius=1.0, worn=False, all_wheels=1.0):
    logs = []
    for k in range(4):
        rng = np.random.default_rng([seed, k])
        u = np.repeat(rng.uniform(-3.0, 3.0, (SAMPLES // 20, 2)), 20, axis=0)
        # Encoders count turns, of which the old radius makes speeds.
        right = side(u[:, 0], radius * all_wheels) / all_wheels
        left = side(u[:, 1], all_wheels, *((0.93, FC + 0.5) if worn else ())) / all_wheels
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


def changed_to(**what):
    before, after = recorded(1), recorded(2, **what)
    robot = DifferentialDrive().with_values(M=8.0, J=0.3, Fv=4.0, Fc=1.5, b=LEVER, gain=GAIN)
    return explain_change(output_error(robot, before), output_error(robot, after), before, after)


@pytest.mark.slow
def test_two_worn_tyres_may_be_a_load_that_is_gone():
    found = changed_to(all_wheels=0.96)
    assert found.verdict == "ambiguous", found.sentence
    assert found.change.id == "radius_of_all_wheels" and "payload" in [own.id for own in found.equivalent]
    (size,) = (own.size for own in found.change.differences.values())
    assert size.value == pytest.approx(-0.04, abs=3 * size.std_error) and size.std_error < 0.003


@pytest.mark.slow
def test_a_gear_that_is_worn_on_one_side_is_no_radius_alone():
    found = changed_to(worn=True)
    gear = "friction_of_left_wheel+drive_of_left_wheel"
    named = {"+".join(sorted(own.id.split("+"))): own for own in (found.change, *found.equivalent)}
    gear = named["+".join(sorted(gear.split("+")))]
    torque, dry, viscous = (
        next(own for name, own in gear.differences.items() if name.endswith(end)).size
        for end in (".torque", ".coulomb", ".viscous")
    )
    assert torque.value == pytest.approx(-0.07, abs=3 * torque.std_error) and torque.std_error < 0.01
    assert dry.value == pytest.approx(0.5 / FC, abs=3 * dry.std_error)
    assert viscous.value == pytest.approx(0.0, abs=3 * viscous.std_error)


def test_all_wheels_larger_are_more_of_what_drives_move():
    radius = {own.id: own for own in candidates_of(DifferentialDrive())}["radius_of_all_wheels"]
    numbers = {"M": 8.0, "J": 0.5}
    assert radius.move(numbers, np.array([-0.04])) == pytest.approx({"M": 8.0 * 0.96**2, "J": 0.5 * 0.96**2})


def test_a_drive_has_less_torque_by_the_share_of_its_own():
    robot = DifferentialDrive().with_values(gain=2.0, back_emf=1.5, b=0.2, Fv=0.0, Fc=0.0)
    left = {own.id: own for own in candidates_of(robot)}["drive_of_left_wheel"]
    with_it = robot + left.effects[0]
    weaker = with_it.with_values(**left.move(robot.parameters.numbers, np.array([-0.25])))
    state = {"v": 0.3, "w": 0.4}
    forces = [2.0 * (5.0 - 1.5 * (0.3 + 0.2 * 0.4)), 0.75 * 2.0 * (4.0 - 1.5 * (0.3 - 0.2 * 0.4))]
    rates = weaker.rates(state, (5.0, 4.0), (0.0, 0.0), weaker.parameters.numbers)
    M, J = (robot.parameters[name].value for name in ("M", "J"))
    assert float(rates["v"]) == pytest.approx(sum(forces) / M)
    assert float(rates["w"]) == pytest.approx(0.2 * (forces[0] - forces[1]) / J)


@pytest.mark.parametrize("robot", [Pioneer(), Omni()])
def test_of_a_robot_with_a_radius_all_wheels_larger_are_another_radius(robot):
    (name,) = robot.with_larger_wheels(robot.parameters.numbers, 0.1)
    assert name == robot.wheel_radius
    assert robot.with_larger_wheels({name: 0.1}, 0.1)[name] == pytest.approx(0.11)
