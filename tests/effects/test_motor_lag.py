"""jaxid/effects/actuator/motor_lag.py: ramps of several inputs against one that takes a thousand small steps."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import (
    AXIS,
    Axis,
    Channels,
    Custom,
    DifferentialDrive,
    DriveAxis,
    EffectError,
    Log,
    LogSet,
    Omni,
    Parameter,
    Pioneer,
    simulate,
)
from jaxid.effects import effect_by_id, laws_of
from jaxid.effects.actuator.motor_lag import InductanceOfTorques
from tests.effects.at_once import commanded

STEP, PARTS = 0.02, 1000


def _held_and_ramped(inputs, rates):
    """Mean over each step of a signal [T, n] that follows `inputs` at `rates` [units/s] at most, from zero."""
    found, x = [], np.zeros(inputs.shape[1])
    most = np.asarray(rates) * STEP / PARTS
    for wanted in inputs:
        total = np.zeros_like(x)
        for _ in range(PARTS):
            after = x + np.clip(wanted - x, -most, most)
            total, x = total + (x + after) / 2, after
        found.append(total / PARTS)
    return np.array(found)


def _unequal(inputs, away, back):
    """The same of one that speeds up at `away` and slows down at `back`, both [units/s]."""
    found, x = [], np.zeros(inputs.shape[1])
    for wanted in inputs:
        total = np.zeros_like(x)
        for _ in range(PARTS):
            most = np.where(x * (wanted - x) < 0, back, away) * STEP / PARTS
            after = x + np.clip(wanted - x, -most, most)
            total, x = total + (x + after) / 2, after
        found.append(total / PARTS)
    return np.array(found)


def _commands():
    random = np.random.default_rng(5)
    return np.repeat(random.uniform(-1.0, 1.0, (12, 2)), 10, axis=0)


def _ramped_by(law, robot, numbers, inputs):
    (effect,) = [one for one in laws_of(robot, "motor_lag") if one.law == law]
    p = {effect.key(name): value for name, value in numbers.items()}
    steps = np.full(len(inputs), STEP)
    return commanded(effect, inputs, STEP * np.arange(len(inputs)), steps, p, robot)


def test_a_ramp_of_each_motor():
    inputs, robot = _commands(), DifferentialDrive()
    found = _ramped_by("ramp_per_motor", robot, {"time_per_unit_u_right": 0.4, "time_per_unit_u_left": 1.25}, inputs)
    np.testing.assert_allclose(found, _held_and_ramped(inputs, [2.5, 0.8]), atol=1e-6)
    assert np.max(np.abs(found - inputs)) > 0.5


@pytest.mark.parametrize("robot", [DifferentialDrive(), Pioneer()], ids=lambda robot: robot.name)
def test_a_body_s_ramps_limit_its_speed_and_yaw_rate_and_not_the_sides(robot):
    """Speed and yaw rate limited apart; with the sum alone limited, a turn on the spot passes unchanged."""
    inputs = _commands()
    body = np.stack([inputs.sum(axis=1), inputs[:, 0] - inputs[:, 1]], axis=1) / 2
    mean, half = _held_and_ramped(body, [1.0, 2.0]).T
    found = _ramped_by("ramp_of_body", robot, {"time_per_unit_mean": 1.0, "time_per_unit_difference": 0.5}, inputs)
    np.testing.assert_allclose(found, np.stack([mean + half, mean - half], axis=1), atol=1e-6)
    on_the_spot = inputs[:, :1] * [1.0, -1.0]
    found = _ramped_by("ramp_of_body", robot, {"time_per_unit_mean": 5.0, "time_per_unit_difference": 0.0}, on_the_spot)
    np.testing.assert_allclose(found, on_the_spot, atol=1e-6)


@pytest.mark.slow
def test_slowing_down_at_another_rate_than_speeding_up():
    inputs = _commands()
    found = _ramped_by("unequal_ramps", Pioneer(), {"time_per_unit": 1.0, "share_back": 0.25}, inputs)
    np.testing.assert_allclose(found, _unequal(inputs, 1.0, 4.0), atol=3e-3)
    assert np.max(np.abs(found - _held_and_ramped(inputs, [1.0, 1.0]))) > 0.3


def test_a_lag_that_lets_go_more_slowly_than_it_pulls():
    """Beside SciPy's solution of the lag's equation, a time constant for either way."""
    inputs, (pull, release) = _commands(), (0.08, 0.3)
    found = _ramped_by("unequal_lags", Pioneer(), {"time_constant": pull, "ratio_back": release / pull}, inputs)

    def slope(t, x, u):
        return np.append((u - x[:2]) / np.where((u - x[:2]) * x[:2] >= 0, pull, release), x[:2])

    x, mean = np.zeros(4), []
    for u in inputs:
        x[2:] = 0.0
        x = solve_ivp(slope, (0.0, STEP), x, args=(u,), rtol=1e-9, atol=1e-11, max_step=STEP / 20).y[:, -1]
        mean.append(x[2:] / STEP)
    np.testing.assert_allclose(found, mean, atol=2e-4)
    assert np.max(np.abs(found - _ramped_by("first_order", Pioneer(), {"time_constant": pull}, inputs))) > 0.3


def test_an_inductance_of_an_axis_makes_the_back_emf_late_as_well():
    """Beside SciPy's solution of the winding's equation, L/R di/dt = (u - e v) / R - i, with the force gain R i."""
    mass, viscous, gain, emf, lag = 2.0, 1.5, 3.0, 4.0, 0.04
    commands, times = np.repeat([5.0, -3.0, 0.0, 4.0], 25), 0.02 * np.arange(101)
    axis = Axis().with_values(M=mass, Fv=viscous, Fc=0.0, gain=gain, back_emf=emf)
    robot = (axis + effect_by_id(axis, "motor_lag", "late_torque")).with_values(**{"motor_lag.time_constant": lag})
    log = Log.from_arrays("one", times, np.append(commands, 0.0)[:, None], np.zeros((101, 1)), AXIS)
    found = simulate(robot, LogSet([log]))[0][:, 0]
    at_once = simulate(axis, LogSet([log]))[0][:, 0]

    def motion(t, x, u):
        v, force = x
        return [(force - viscous * v) / mass, (gain * (u - emf * v) - force) / lag]

    x, truth = np.zeros(2), [0.0]
    for k, u in enumerate(commands):
        x = solve_ivp(motion, times[k : k + 2], x, args=(u,), rtol=1e-10, atol=1e-12).y[:, -1]
        truth.append(x[0])
    np.testing.assert_allclose(found, truth, atol=2e-3 * np.max(np.abs(truth)))
    assert np.max(np.abs(at_once - truth)) > 0.1 * np.max(np.abs(truth))


def test_an_inductance_needs_torques_that_fall_with_the_speed():
    with pytest.raises(EffectError, match="lag of the command"):
        Axis() + InductanceOfTorques()
    with pytest.raises(EffectError, match="windings of 'omni' are known"):
        Omni() + InductanceOfTorques()
    assert "late_torque" in [law.law for law in laws_of(Axis().with_values(back_emf=2.0), "motor_lag")]


def test_an_inductance_needs_no_currents_that_a_user_declares():
    """Torques alone, of the command and the speed, as a file or a function states them."""
    table = {"gain": Parameter(2.0), "emf": Parameter(1.5), "M": Parameter(3.0, "kg"), "Fv": Parameter(1.0)}

    def torque(s, u, p):
        return p["gain"] * (u["u"] - p["emf"] * s["v"])

    cart = Custom(
        dynamics=lambda s, u, p, f: {"v": (torque(s, u, p) - p["Fv"] * s["v"] - f["wheel"]) / p["M"]},
        state_names=("v",),
        own_channels=Channels(("u",), ("v",), units={"u": "V", "v": "m/s"}),
        table=table,
        axes={"wheel": DriveAxis(speed="v", viscous="Fv", torque=torque)},
    )
    assert "late_torque" in [law.law for law in laws_of(cart, "motor_lag")]


@pytest.mark.parametrize(
    ("shares", "same"), [((0.98, -0.02, 0.01), True), ((0.0, 0.6, 0.4), True), ((0.3, 0.3, 0.2), False)]
)
def test_a_response_by_two_neighbouring_delays_may_be_a_delay(shares, same):
    robot = Axis()
    robot = robot + effect_by_id(robot, "motor_lag", "shape")
    names = ("motor_lag.share_1", "motor_lag.share_2", "motor_lag.share_4")
    robot = robot.with_values(**dict(zip(names, shares, strict=True)))
    assert robot.effects[0].same_on(robot) == ("input_delay" if same else "")
