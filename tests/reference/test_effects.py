"""Every hidden effect: none at zero strength, visible otherwise, and right where a closed form is at hand."""

import numpy as np
import pytest

from reference.axis import AXIS
from reference.effects import EFFECTS, NONE, NOT_FOR
from reference.excitation import experiment
from reference.logs import simulate, simulate_log
from reference.omni import OMNI
from reference.pioneer import PIONEER

ROBOTS = {"pioneer": PIONEER, "omni": OMNI, "axis": AXIS}
STRENGTH = {
    "actuator_dead_zone": {"threshold": 0.5},
    "voltage_saturation": {"limit": 1.0},
    "battery_sag": {"resistance": 0.2},
    "motor_lag": {"time_constant": 0.05},
    "input_delay": {"delay": 0.033},
    "motor_gain_mismatch": {"mismatch": 0.1},
    "motor_heating": {"coefficient": 0.001},
    "stribeck_friction": {"amplitude": 0.2},
    "asymmetric_friction": {"asymmetry": 0.2},
    "asymmetric_viscous_friction": {"asymmetry": 0.3},
    "sublinear_viscous_friction": {"deficit": 0.4},
    "cogging_torque": {"amplitude": 0.1},
    "wheel_radius_mismatch": {"mismatch": 0.05},
    "traction_limit": {"limit": 2.0},
    "surface_change": {"coulomb": 0.5},
    "ground_slope": {"angle": 0.02, "direction": 1.0},
    "quadratic_drag": {"coefficient": 3.0},
    "lateral_com_offset": {"offset": 0.02},
    "coriolis_coupling": {"absent": 1.0},
    "sensor_bias": {"bias": 0.02},
    "sensor_scale": {"error": 0.05},
    "sensor_lag": {"time_constant": 0.05},
    "sensor_delay": {"delay": 0.033},
    "push": {"force": 20.0, "start": 2.0},
    "collision": {"speed_loss": 1.3, "time": 2.21},
    "payload_drop": {"mass": 0.3, "time": 2.0},
    "resonance": {"mass": 0.5},
    "hysteresis": {"force": 2.0},
}
CASES = [(robot, effect) for robot in ROBOTS for effect in EFFECTS if effect not in NOT_FOR[robot]]


@pytest.fixture(scope="module")
def plain():
    inputs = {name: experiment(name, "multilevel", 200, seed=8) for name in ROBOTS}
    return {name: (inputs[name], simulate(robot, inputs[name], 0.02)) for name, robot in ROBOTS.items()}


def test_every_effect_is_tried():
    assert set(STRENGTH) == set(EFFECTS)


@pytest.mark.parametrize(("robot", "effect"), CASES)
def test_zero_strength_changes_nothing(robot, effect, plain):
    inputs, base = plain[robot]
    run = simulate(ROBOTS[robot], inputs, 0.02, {effect: EFFECTS[effect]})
    assert np.array_equal(run.speeds, base.speeds)


@pytest.mark.parametrize(("robot", "effect"), CASES)
def test_strength_changes_the_speeds(robot, effect, plain):
    inputs, base = plain[robot]
    strength = dict(STRENGTH[effect])
    if (robot, effect) == ("pioneer", "traction_limit"):
        strength["limit"] = 14.0
    if effect == "surface_change":  # the line lies in the middle of the way
        strength["angle"] = np.pi / 2 if robot == "pioneer" else 0.0
        strength["offset"] = float(base.states[:, 1 if robot == "pioneer" else 0].mean())
    run = simulate(ROBOTS[robot], inputs, 0.02, {effect: strength})
    assert np.isfinite(run.speeds).all()
    assert np.abs(run.speeds - base.speeds).max() > 1e-4


def test_plain_strengths_of_limits_are_never_reached():
    assert EFFECTS["voltage_saturation"]["limit"] == EFFECTS["traction_limit"]["limit"] == NONE


@pytest.mark.parametrize("effect", ["input_delay", "sensor_delay"])
def test_whole_sample_delays_shift_the_speeds(effect, plain):
    inputs, base = plain["pioneer"]
    run = simulate(PIONEER, inputs, 0.02, {effect: {"delay": 0.06}})
    np.testing.assert_allclose(run.speeds[3:], base.speeds[:-3], atol=1e-9)


def test_fractional_delays_of_input_and_sensor_look_the_same(plain):
    inputs, _ = plain["pioneer"]
    one, other = (
        simulate(PIONEER, inputs, 0.02, {name: {"delay": 0.033}}).speeds for name in ("input_delay", "sensor_delay")
    )
    np.testing.assert_allclose(one, other, atol=1e-8)


def test_axis_lag_follows_the_closed_form():
    robot = AXIS.with_parameters(Cs=0.0, Cv=0.5)
    run = simulate(robot, np.ones((200, 1)), 0.02, {"motor_lag": {"time_constant": 0.1}})
    a, b, t = 0.5, 10.0, run.t
    expected = 1 / a - (b / a * np.exp(-a * t) - np.exp(-b * t)) / (b - a)
    np.testing.assert_allclose(run.speeds[:, 0], expected, atol=1e-8)
    lagged = simulate(robot, np.ones((200, 1)), 0.02, {"sensor_lag": {"time_constant": 0.1}})
    np.testing.assert_allclose(lagged.speeds[:, 0], expected, atol=1e-8)  # linear: the place of a lag cannot be seen


def test_slope_holds_below_and_slides_above_the_friction_angle():
    grip = np.arcsin(AXIS.parameters["Cs"] / 9.81)
    held, sliding = (
        simulate(AXIS, np.zeros((50, 1)), 0.02, {"ground_slope": {"angle": grip + d}}) for d in (-1e-6, 1e-6)
    )
    assert not held.speeds.any() and sliding.speeds[-1, 0] > 0


def test_pioneer_on_a_slope_rolls_downhill_with_its_whole_mass():
    free = PIONEER.with_parameters(Cs=0.0, Cv=0.0, Cs1=0.0, Cv1=0.0, KT=0.0, tau_fr=0.0)
    run = simulate(free, np.zeros((51, 2)), 0.02, {"ground_slope": {"angle": 0.05, "direction": np.pi / 2}})
    assert run.speeds[-1, 0] == pytest.approx(9.81 * np.sin(0.05) * (15.5 + 0.7 + 0.35) / 17.0776, rel=1e-4)


def test_battery_sag_satisfies_the_supply_equation():
    sag = {"resistance": 0.3, "nominal": 12.0}
    run = simulate(OMNI, np.full((2, 4), 6.0), 0.02, {"battery_sag": sag})
    current = run.currents[0]  # at rest: no back-EMF
    supply = 12.0 - 0.3 * np.sum(0.5 * current)
    np.testing.assert_allclose(current, 0.5 * supply / 0.6)


def test_stribeck_raises_break_away():
    inputs = np.full((100, 1), 0.6)
    assert simulate(AXIS, inputs, 0.02).speeds[-1, 0] > 0
    assert not simulate(AXIS, inputs, 0.02, {"stribeck_friction": {"amplitude": 0.11}}).speeds.any()


def test_wrong_effects_are_refused():
    inputs = np.zeros((3, 1))
    with pytest.raises(ValueError, match="Unknown effect 'magic'"):
        simulate(AXIS, inputs, 0.02, {"magic": {}})
    with pytest.raises(ValueError, match="no parameter 'size'"):
        simulate(AXIS, inputs, 0.02, {"sensor_bias": {"size": 1.0}})
    with pytest.raises(ValueError, match="does not apply to the robot 'axis'"):
        simulate(AXIS, inputs, 0.02, {"battery_sag": {"resistance": 1.0}})
    with pytest.raises(ValueError, match="shape"):
        simulate(PIONEER, inputs, 0.02)


def test_logs_have_the_standard_columns_and_the_stated_noise():
    inputs = experiment("omni", "steps", 400, seed=1)
    noise = (0.01, 0.02, 0.03)
    log, again = (simulate_log(OMNI, inputs, 0.02, noise, seed=5, current_noise=0.05) for _ in range(2))
    assert list(log) == ["t", "u1", "u2", "u3", "u4", "V", "Vn", "W", "i1", "i2", "i3", "i4"]
    assert log.equals(again)
    error = log[["V", "Vn", "W"]].to_numpy() - simulate(OMNI, inputs, 0.02).speeds
    np.testing.assert_allclose(error.std(0), noise, rtol=0.12)
    assert list(simulate_log(AXIS, np.zeros((4, 1)), 0.02)) == ["t", "u", "v", "q"]
    assert list(simulate_log(PIONEER, np.zeros((4, 2)), 0.02)) == ["t", "V2", "V3", "eta1", "eta2"]
