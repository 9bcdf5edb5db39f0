"""The plain differential drive against mechanics written in world coordinates with the axle's constraint."""

import numpy as np
import pytest

from jaxid import DifferentialDrive, Log, LogSet, simulate
from jaxid._float64 import float64
from jaxid.effects import catalogue, effect_by_id
from jaxid.effects.body.drag import LAWS as DRAG
from jaxid.effects.ground.turning_friction import LAWS as SCRUBBING


def constrained(state, u, p, dry):
    """dv/dt and dw/dt from Newton's laws of the body in world coordinates, the axle kept from slipping by a multiplier, and of
    rotors that take their share of each rim's force: Mr / 2 times the rim's acceleration."""
    carried, rotor = p["M"] - p["Mr"], p["Mr"] / 2
    theta, v, w = state["theta"], state["v"], state["w"]
    along, left = np.array([np.cos(theta), np.sin(theta)]), np.array([-np.sin(theta), np.cos(theta)])
    radii = np.array([1 + p["radius_mismatch"], 1 - p["radius_mismatch"]])
    ends = np.array([v + p["b"] * w, v - p["b"] * w])
    wheels = ends / radii
    rims = (p["gain"] * (np.array(u) - p["back_emf"] * wheels) - p["Fv"] * wheels - np.array(dry)) / radii
    arm = p["xc"] * along + p["yc"] * left  # from the axle's middle to the centre of mass
    # Unknowns: acceleration of the axle's middle (2), dw/dt, sideways force of the axle.
    A, b = np.zeros((4, 4)), np.zeros(4)
    across = np.array([-arm[1], arm[0]])
    A[:2, :2], A[:2, 2], A[:2, 3] = carried * np.eye(2) + 2 * rotor * np.outer(along, along), carried * across, -left
    b[:2] = rims.sum() * along + carried * w**2 * arm
    # About the centre of mass: J dw/dt = moment of the rims' forces and of the sideways one.
    forces = [(p["b"] * -left, rims[0]), (p["b"] * left, rims[1])]
    levers = np.array([(s - arm)[0] * along[1] - (s - arm)[1] * along[0] for s, _ in forces])
    moment = sum(lever * f for lever, (_, f) in zip(levers, forces, strict=True))
    # J holds what the rotors add about the axle's middle; about the centre of mass the body has the rest.
    A[2, :2] = rotor * levers.sum() * along
    A[2, 2] = p["J"] - 2 * rotor * p["b"] ** 2 + rotor * p["b"] * (levers[0] - levers[1])
    A[2, 3], b[2] = arm[0] * left[1] - arm[1] * left[0], moment
    A[3, :2], b[3] = left, v * w  # no sideways speed: left . a = v w
    a = np.linalg.solve(A, b)
    return along @ a[:2], a[2]


def cases(n=20):
    rng = np.random.default_rng(2)
    for _ in range(n):
        p = {k: v * np.exp(rng.uniform(-1, 1)) for k, v in DifferentialDrive().parameters.numbers.items()}
        p |= {"xc": rng.uniform(-0.2, 0.2), "yc": rng.uniform(-0.1, 0.1), "back_emf": rng.uniform(0, 2)}
        p["radius_mismatch"] = rng.uniform(-0.1, 0.1)
        p["Mr"] = rng.uniform(0, 0.5) * p["M"]
        state = {"theta": rng.uniform(-3, 3), "v": rng.normal(), "w": rng.normal(), "x": 0.0, "y": 0.0}
        yield state, tuple(rng.normal(size=2) * 5), tuple(rng.normal(size=2)), p


def test_it_obeys_newtons_laws_with_an_axle_that_does_not_slip():
    robot, wheels = DifferentialDrive(pose=True), DifferentialDrive(measures="wheels", pose=True)
    with float64():
        for state, u, dry, p in cases():
            rates = robot.rates(state, u, dry, p)
            expected = constrained(state, u, p, dry)
            np.testing.assert_allclose([rates["v"], rates["w"]], expected, rtol=1e-9)
            # In the wheels' speeds: the same motion.
            larger, smaller = 1 + p["radius_mismatch"], 1 - p["radius_mismatch"]
            own = {k: state[k] for k in ("theta", "x", "y")}
            own |= {"v_right": (state["v"] + p["b"] * state["w"]) / larger}
            own |= {"v_left": (state["v"] - p["b"] * state["w"]) / smaller}
            turned = wheels.rates(own, u, dry, p)
            for name in ("x", "y", "theta"):
                assert float(turned[name]) == pytest.approx(float(rates[name]), rel=1e-9)
            right = (expected[0] + p["b"] * expected[1]) / larger
            assert float(turned["v_right"]) == pytest.approx(right, rel=1e-9)


def test_body_and_wheel_speeds_show_one_motion_effects_included():
    """With every effect that both can have, at sizes that matter, the wheels' speeds are those of the body."""
    values = {"Fc": 2.0, "xc": 0.05}
    n = 200
    time, u = 0.02 * np.arange(n), np.repeat(np.random.default_rng(3).uniform(-15, 15, (n // 20, 2)), 20, axis=0)
    robots = [DifferentialDrive(), DifferentialDrive(measures="wheels")]
    # Those on sensors act on other channels.
    shared = [e for e in catalogue(robots[1]) if e.where != "sensor"]
    assert {e.id for e in catalogue(robots[0])} == {e.id for e in catalogue(robots[1])}
    outputs = []
    for robot in robots:
        for effect in shared:
            robot = robot + effect
        size = {
            "ground_slope.slope_x": 0.02,
            "stribeck_friction.amplitude": 0.5,
            "surface_change.coulomb": 0.4,
            "motor_gain_mismatch.gain_u_left": 0.05,
            "traction_limit.inverse_limit": 1 / 14,
            "cogging_torque.sine_way_left": 0.5,
            "quadratic_drag.coefficient": 2.0,
            "turning_friction.coulomb": 0.2,
            "turning_friction.viscous": 0.05,
            "turning_friction.still": 0.01,
        }
        robot = robot.with_values(**values, **size)
        log = Log.from_arrays("a", time, u, np.zeros((n, 2)), robot.channels)
        outputs.append(simulate(robot, LogSet([log]))[0])
    v, w = outputs[0].T
    b = 0.2
    assert np.ptp(v) > 0.3 and np.ptp(w) > 1
    np.testing.assert_allclose(outputs[1], np.stack([v + b * w, v - b * w], 1), atol=2e-6)


@pytest.mark.parametrize("mismatch", [0.0, 0.04])
@pytest.mark.parametrize(("name", "law"), [(e.id, e.law) for e in (*DRAG, *SCRUBBING) if e.law != "per_axis"])
def test_drag_and_scrubbing_are_the_same_measured_at_the_wheels(name, law, mismatch):
    """Accelerations of the body, whichever speeds are the states."""
    body, wheels = DifferentialDrive(), DifferentialDrive(measures="wheels")
    found = []
    for robot in (body, wheels):
        robot = robot + effect_by_id(robot, name, law)
        own = {n: 0.3 for n in robot.parameters.numbers if n.startswith(name)}
        right, left = 1.1 / (1.0 + mismatch), 0.7 / (1.0 - mismatch)  # v = 0.9, w = 1.0
        state = {"v": 0.9, "w": 1.0} if robot.measures == "body" else {"v_right": right, "v_left": left}
        p = {**robot.parameters.numbers, **own, "radius_mismatch": mismatch}
        with float64():
            rates = robot.rates(state, (4.0, 3.0), (0.0, 0.0), p)
        found.append({n: float(x) for n, x in rates.items()})
    ends = found[1]["v_right"] * (1.0 + mismatch), found[1]["v_left"] * (1.0 - mismatch)
    assert 0.5 * sum(ends) == pytest.approx(found[0]["v"], abs=1e-9)
    assert (ends[0] - ends[1]) / 0.4 == pytest.approx(found[0]["w"], abs=1e-9)


def test_columns_decide_what_it_measures():
    robot = DifferentialDrive()
    assert robot.for_columns(["t", "u_right", "u_left", "v", "w"]).measures == "body"
    assert robot.for_columns(["t", "u_right", "u_left", "v_right", "v_left"]).measures == "wheels"
    assert robot.for_columns(["t", "u_right", "u_left", "v_right", "v_lfet"]).measures == "wheels"
    assert robot.for_columns(["t", "u_right", "u_left", "v_right", "way_right", "way_left"]).measures == "body"


@pytest.mark.wrong_types
def test_it_measures_body_or_wheels():
    with pytest.raises(ValueError, match="use 'body'"):
        DifferentialDrive(measures="gyro")  # type: ignore[arg-type]
