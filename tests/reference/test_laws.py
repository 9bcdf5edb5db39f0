"""Every law: nothing at zero strength, something otherwise, and right against its formula, a closed form or energy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from reference import curves
from reference.axis import AXIS
from reference.effects import E
from reference.excitation import experiment
from reference.law_forces import bristles, dry, gripped, motor_drives, rippled, supplied, viscous_more
from reference.law_signals import commanded, sensed
from reference.law_table import LAWS, applies, complete_laws
from reference.law_vector import LENGTH, K, law_vector
from reference.logs import simulate
from reference.omni import OMNI
from reference.pioneer import PIONEER

ROBOTS = {"pioneer": PIONEER, "omni": OMNI, "axis": AXIS}
CASES = [(robot, law) for robot in ROBOTS for law in LAWS if applies(law, robot)]
LARGER = {"inverse_limit": 0.5, "threshold": 1.5, "amplitude": 0.3, "share": 0.3, "resistance": 0.2, "drop": 1.0}
MORE = {"surface_change/disc": {"radius": 10.0}, "surface_change/drawn": {"width": 0.1}}


def vector(robot: str, law: str, **values: float) -> np.ndarray:
    """The law's vector behind zeros for the effects."""
    own = complete_laws({law: values}, robot)
    return np.append(np.zeros(len(E)), law_vector(own, ROBOTS[robot].n_axes, len(ROBOTS[robot].inputs)))


@pytest.fixture(scope="module")
def plain():
    inputs = {name: experiment(name, "multilevel", 200, seed=8) for name in ROBOTS}
    return {name: (inputs[name], simulate(robot, inputs[name], 0.02)) for name, robot in ROBOTS.items()}


def test_each_mechanism_has_laws_of_its_own_and_a_drawn_one():
    for mechanism in {law.split("/")[0] for law in LAWS}:
        words = {law.split("/")[1] for law in LAWS if law.startswith(f"{mechanism}/")}
        if mechanism not in ("input_delay", "sensor_delay", "backlash", "wheel_radius_mismatch"):
            assert len(words) >= 3 - (mechanism == "sensor_scale") and "drawn" in words, mechanism


@pytest.mark.parametrize(("robot", "law"), CASES)
def test_zero_strength_changes_nothing_and_strength_does(robot, law, plain):
    inputs, base = plain[robot]
    strength = next(iter(LAWS[law]))
    none = simulate(ROBOTS[robot], inputs, 0.02, laws={law: {}})
    assert np.array_equal(none.speeds, base.speeds)
    size = LARGER.get(strength, 0.1)
    run = simulate(ROBOTS[robot], inputs, 0.02, laws={law: {strength: size, **MORE.get(law, {})}})
    assert np.isfinite(run.speeds).all()
    assert np.abs(run.speeds - base.speeds).max() > 1e-5


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_laws_motors_without_a_law_are_the_plain_ones(robot, plain):
    inputs, base = plain[robot]
    run = simulate(ROBOTS[robot], inputs, 0.02, laws={"load_dependent_friction/level": {"share": 1e-13}})
    np.testing.assert_allclose(run.speeds, base.speeds, atol=1e-9)


def test_laws_stand_beside_effects(plain):
    inputs, _ = plain["pioneer"]
    slope = {"ground_slope": {"angle": 0.03}}
    one = simulate(PIONEER, inputs, 0.02, slope, laws={"traction_limit/tanh": {"inverse_limit": 1e-9}})
    np.testing.assert_allclose(one.speeds, simulate(PIONEER, inputs, 0.02, slope).speeds, atol=1e-7)
    with pytest.raises(ValueError, match="leave .'lag'. out"):
        simulate(
            PIONEER,
            inputs,
            0.02,
            {"motor_lag": {"time_constant": 0.1}},
            laws={"traction_limit/tanh": {"inverse_limit": 0.1}},
        )


@pytest.mark.parametrize(
    ("word", "shape"),
    [
        ("exponential", lambda z: np.exp(-z)),
        ("lorentzian", lambda z: 1 / (1 + z * z)),
        ("root", lambda z: np.exp(-np.sqrt(z))),
        ("one_wheel", lambda z: np.exp(-z * z)),
        ("drawn", lambda z: curves.evaluate(curves.falling(3), np.minimum(z / 3, 1.0))),
    ],
)
def test_stribeck_curves(word, shape):
    own = {"seed": 3.0} if word == "drawn" else {"wheel": 2.0} if word == "one_wheel" else {}
    e = vector("pioneer", f"stribeck_friction/{word}", amplitude=0.4, speed=0.05, **own)
    for s in (-0.3, -0.04, 0.0, 0.02, 0.11):
        level = np.full((2, 3), 0.5)
        for k in range(3):
            dry(0.5, s, 0.0, k, 1.0 if k < 2 else 0.0, e, level)
        expected = 0.5 + 0.4 * float(shape(np.array(abs(s) / 0.05)))
        right = 0.5 if word == "one_wheel" else expected
        np.testing.assert_allclose(level, [[right, expected, 0.5]] * 2, rtol=1e-12)


def test_load_and_direction_change_the_levels():
    level = np.full((2, 1), 2.0)
    dry(2.0, 0.3, -4.0, 0, 1.0, vector("axis", "load_dependent_friction/efficiency", share=0.1, driven=0.5), level)
    np.testing.assert_allclose(level, 2.2)  # the load drives: half of a tenth of 4
    level = np.full((2, 3), 2.0)
    e = vector("omni", "asymmetric_friction/one_wheel", asymmetry=0.2, wheel=3)
    for k in range(3):
        dry(2.0, 0.3, 0.0, k, 1.0, e, level)
    np.testing.assert_allclose(level, [[2, 2, 2.4], [2, 2, 1.6]])


def test_viscous_shapes():
    s = 0.7
    tanh = 3.0 * s + viscous_more(3.0, s, s, 0, vector("axis", "sublinear_viscous_friction/tanh", curvature=2.0))
    assert tanh == pytest.approx(3.0 * np.tanh(1.4) / 2.0)
    cubic = viscous_more(3.0, -s, -s, 0, vector("axis", "sublinear_viscous_friction/cubic", coefficient=0.5))
    assert cubic == pytest.approx(-3.0 * 0.5 * s**3)
    e = vector("omni", "asymmetric_viscous_friction/one_wheel", asymmetry=0.2, wheel=1)
    assert viscous_more(3.0, -s, -s, 0, e) == pytest.approx(0.2 * 3.0 * s)  # backwards less: 0.8 of it in all
    assert viscous_more(3.0, -s, -s, 1, e) == 0.0


def test_drag_slows_a_coasting_axis_as_its_formula_does():
    free = AXIS.with_parameters(Cs=0.0, Cv=0.0, k=0.0)
    run = simulate(free, np.zeros((100, 1)), 0.02, laws={"quadratic_drag/cubic": {"coefficient": 0.5}}, start={1: 2.0})
    np.testing.assert_allclose(run.speeds[:, 0], 2.0 / np.sqrt(1 + run.t * 0.5 * 2 * 4.0), rtol=1e-8)


def test_torque_constant_and_winding_resistance_are_the_motor_equations():
    """A blocked motor's torque is Kt u / R, and a motor that runs free stops at u / Ke: then only Kt is seen."""
    blocked = PIONEER.with_parameters(Cs=100.0)
    for word, kt, ohm in (("torque_constant", 1.1, 1.0), ("winding_resistance", 1.0, 1.1)):
        e = vector("pioneer", f"motor_gain_mismatch/{word}", mismatch=0.1, motor=2)
        drive, x = np.zeros(2), np.zeros(30)
        motor_drives(np.array([3.0, 3.0]), np.array([2.0, 2.0]), 0.5, 0.7, 1.3, 0.1, 2, x, np.zeros(30), 0, e, drive)
        np.testing.assert_allclose(drive, [1.3 * (3 - 1.0) / 0.7, 1.3 * kt * (3 - 1.0 * kt) / (0.7 * ohm)])
    laws = {"motor_gain_mismatch/torque_constant": {"mismatch": 0.1}}
    assert not simulate(blocked, np.full((20, 2), 3.0), 0.02, laws=laws).speeds.any()


def test_supply_under_load_is_consistent():
    command, emf, ohm = np.array([9.0, -7.0]), np.array([3.0, -1.0]), np.array([0.7, 0.7])
    x, xdot = np.array([0.4, 5.0]), np.zeros(2)
    e = vector("pioneer", "battery_sag/recovery", resistance=0.2, nominal=12.0, time=4.0)
    factor = supplied(command, emf, ohm, 2, x, xdot, 0, e)
    total = np.sum(np.abs(command * factor - emf) / ohm)
    assert factor == pytest.approx(1 - (0.1 * total + 0.4) / 12.0, abs=1e-12)
    np.testing.assert_allclose(xdot, [(0.1 * total - 0.4) / 4.0, total])
    x = np.array([0.0, 5.0])
    e = vector("pioneer", "battery_sag/charge", fall=0.01)
    assert supplied(command, emf, ohm, 2, x, xdot, 0, e) == pytest.approx(1 - 0.05 / 12.0)


def test_grip():
    for word, seed in (("tanh", {}), ("drawn", {"seed": 2.0}), ("one_wheel", {"wheel": 1.0})):
        e = vector("pioneer", f"traction_limit/{word}", inverse_limit=0.1, **seed)
        forces = np.linspace(-40, 40, 81)
        passed = np.array([gripped(f, 0, e) for f in forces])
        assert (np.diff(passed) >= -1e-12).all() and np.allclose(passed, -passed[::-1])
        assert gripped(0.01, 0, e) == pytest.approx(0.01, rel=1e-2)
        if word == "tanh":
            np.testing.assert_allclose(passed, 10 * np.tanh(forces / 10))
        if word == "one_wheel":
            np.testing.assert_allclose(passed, np.clip(forces, -10, 10))
            assert gripped(40.0, 1, e) == 40.0


def test_ripple():
    e = vector("pioneer", "cogging_torque/by_current", share=0.2, periods=5)
    assert rippled(3.0, 0.4, e) == pytest.approx(3.0 * (1 + 0.2 * np.sin(2.0)))
    e = vector("pioneer", "cogging_torque/two_harmonics", amplitude=0.2, periods=5, share=0.5, phase=0.3)
    assert rippled(3.0, 0.4, e) == pytest.approx(3.0 + 0.2 * (np.sin(2.0) + 0.5 * np.sin(4.3)))
    e = vector("pioneer", "cogging_torque/drawn", amplitude=0.2, periods=5, seed=1)
    assert rippled(3.0, 0.4, e) == pytest.approx(rippled(3.0, 0.4 + 2 * np.pi / 5, e))


def _free_axis(laws, n=300):
    """A frictionless but viscous axis under a binary input, and that input."""
    inputs = np.sign(np.sin(np.arange(n) * 0.11 + 0.4))[:, None]
    return inputs, simulate(AXIS.with_parameters(Cs=0.0, Cv=0.5), inputs, 0.02, laws=laws)


def test_lags_are_linear_systems():
    tau, zeta = 0.06, 0.8
    inputs, run = _free_axis({"motor_lag/second_order": {"time_constant": tau, "damping": zeta}})
    A = np.array([[0, 1, 0], [-1 / tau**2, -2 * zeta / tau, 0], [1, 0, -0.5]])
    expected = lsim((A, np.array([[0], [1 / tau**2], [0]]), np.array([[0, 0, 1]]), 0), inputs, run.t, interp=False)[1]
    np.testing.assert_allclose(run.speeds, expected.reshape(-1, 1), atol=1e-7)
    inputs, run = _free_axis({"sensor_lag/second_order": {"time_constant": tau}})
    A = np.array([[-0.5, 0, 0], [2 / tau, -2 / tau, 0], [0, 2 / tau, -2 / tau]])
    expected = lsim((A, np.array([[1], [0], [0]]), np.array([[0, 0, 1]]), 0), inputs, run.t, interp=False)[1]
    np.testing.assert_allclose(run.speeds, expected.reshape(-1, 1), atol=1e-7)


def test_inductance_lets_the_back_emf_lag_too():
    """One motor of a Pioneer that drives straight: two coupled first-order equations."""
    free = PIONEER.with_parameters(Cs=0.0, Cv=0.0, Cs1=0.0, Cv1=0.0, tau_fr=0.0)
    run = simulate(free, np.full((100, 2), 4.0), 0.02, laws={"motor_lag/inductance": {"time_constant": 0.08}})
    p = free.parameters
    mass, gain = 17.0776, 2 * p["tr"] * p["mu"] * p["KT"] / p["R"]

    def rates(_, x):
        return [gain * x[1] / mass, ((4.0 - p["KE"] * p["tr"] * x[0] / p["R"]) / p["Ra"] - x[1]) / 0.08]

    expected = solve_ivp(rates, (0, run.t[-1]), [0.0, 0.0], t_eval=run.t, rtol=1e-9, atol=1e-11).y[0]
    np.testing.assert_allclose(run.speeds[:, 0], expected, atol=2e-5)  # the mass is rounded


def test_a_drivers_ramp_takes_its_time():
    run = simulate(
        AXIS.with_parameters(Cs=0.0, Cv=0.0),
        np.full((100, 1), 4.0),
        0.02,
        laws={"motor_lag/slew": {"time_per_volt": 0.2}},
    )
    np.testing.assert_allclose(run.speeds[30, 0], 0.5 * 5.0 * run.t[30] ** 2, rtol=0.03)
    assert run.speeds[-1, 0] == pytest.approx(4.0 * (run.t[-1] - 0.4), rel=0.01)


def test_shares_of_delays():
    inputs, base = _free_axis(None)
    late = _free_axis({"sensor_delay/jittering": {"delay": 0.02, "seed": 1}})[1]
    each = np.random.default_rng([1, 79]).uniform(0.0, 0.04, 300)
    from_base = np.interp(np.maximum(base.t - each, 0.0), base.t, base.speeds[:, 0])
    np.testing.assert_allclose(late.speeds[:, 0], from_base, atol=1e-3)
    averaged = _free_axis({"sensor_lag/moving_average": {"time_constant": 0.05}})[1]
    fine = np.interp(np.maximum(base.t[:, None] - np.linspace(0, 0.1, 401), 0), base.t, base.speeds[:, 0]).mean(1)
    np.testing.assert_allclose(averaged.speeds[:, 0], fine, atol=1e-3)
    for law in ("motor_lag/drawn", "sensor_lag/drawn"):  # a slow ramp is late by the mean delay
        ramp = np.repeat(np.arange(300.0)[:, None], 1, axis=1) * 0.01
        one, other = (
            simulate(AXIS.with_parameters(Cs=0.0), ramp, 0.02, laws=own).speeds[:, 0]
            for own in (None, {law: {"time_constant": 0.04, "seed": 2}})
        )
        np.testing.assert_allclose(other[-50:], one[-52:-2], atol=2e-4)


def test_one_motors_delay_is_that_motors(plain):
    inputs, _ = plain["pioneer"]
    run = simulate(PIONEER, inputs, 0.02, laws={"input_delay/one_motor": {"delay": 0.04, "motor": 2}})
    shifted = np.column_stack((inputs[:, 0], np.concatenate((np.zeros(2), inputs[:-2, 1]))))
    np.testing.assert_allclose(run.speeds, simulate(PIONEER, shifted, 0.02).speeds, atol=1e-8)


def test_command_maps():
    u = np.array([[-5.0, -0.4], [0.2, 0.6], [1.5, 7.0]])
    zone = commanded(u, {"actuator_dead_zone/threshold": {"threshold": 0.5}})
    np.testing.assert_array_equal(zone, [[-5, 0], [0, 0.6], [1.5, 7]])
    unequal = commanded(u, {"actuator_dead_zone/unequal": {"threshold": 0.5, "ratio": 0.2}})
    np.testing.assert_allclose(unequal, [[-4.9, -0.3], [0, 0.1], [1, 6.5]])
    one = commanded(u, {"actuator_dead_zone/one_motor": {"threshold": 0.5, "motor": 2.0}})
    np.testing.assert_allclose(one, [[-5, 0], [0.2, 0.1], [1.5, 6.5]])
    drawn = commanded(u, {"actuator_dead_zone/drawn": {"threshold": 0.5, "seed": 4.0}})
    assert (np.abs(drawn) <= np.abs(u)).all() and (drawn[np.abs(u) >= 1.5] == u[np.abs(u) >= 1.5]).all()
    np.testing.assert_allclose(commanded(u, {"voltage_saturation/tanh": {"inverse_limit": 0.25}}), 4 * np.tanh(u / 4))
    limited = commanded(u, {"voltage_saturation/unequal": {"inverse_limit": 0.5}})
    np.testing.assert_allclose(limited, np.minimum(u, 2.0))


def test_sensors():
    time, v = np.linspace(0, 10, 11), np.tile([0.5, -2.0], (11, 1))
    np.testing.assert_allclose(
        sensed(v, time, {"sensor_bias/drifting": {"bias": 0.3, "channel": 2.0}})[5], [0.5, -1.85]
    )
    warm = sensed(v, time, {"sensor_bias/warming": {"bias": 0.3, "channel": 1.0, "time": 5.0}})
    np.testing.assert_allclose(warm[:, 0], 0.5 + 0.3 * (1 - np.exp(-time / 5)))
    crossed = sensed(v, time, {"sensor_cross_talk/misaligned": {"angle": 0.1, "channel": 1.0, "other": 2.0}})
    np.testing.assert_allclose(crossed[0], [0.3, -2.0])
    scaled = sensed(v, time, {"sensor_scale/one_direction": {"error": 0.1, "channel": 1.0}})
    np.testing.assert_allclose(scaled[0], [0.55, -2.0])


def test_a_wider_track_is_another_constant(plain):
    inputs, _ = plain["pioneer"]
    run = simulate(PIONEER, inputs, 0.02, laws={"effective_track/wider": {"share": 0.06}})
    wide = PIONEER.with_parameters(L=1.06 * PIONEER.parameters["L"])
    np.testing.assert_allclose(run.speeds, simulate(wide, inputs, 0.02).speeds, atol=1e-9)


def test_a_drives_track_that_changes_does_as_a_wider_one_does_while_turning():
    """Turning left on the spot without friction: with the wheels at L (1 + share), but for the wheels' own inertia."""
    free = PIONEER.with_parameters(Cs=0.0, Cv=0.0, Cs1=0.0, Cv1=0.0, tau_fr=0.0, Ir=0.0, m=0.0)
    inputs = np.tile([2.0, -2.0], (100, 1))
    left, right = (
        simulate(free, side * inputs, 0.02, laws={"effective_track/by_direction": {"share": 0.1}}).speeds[-1, 1]
        for side in (1.0, -1.0)
    )
    wide, narrow = (
        simulate(free.with_parameters(L=share * free.parameters["L"]), inputs, 0.02).speeds[-1, 1]
        for share in (1.1, 0.9)
    )
    assert left == pytest.approx(wide, rel=2e-3) and -right == pytest.approx(narrow, rel=2e-3)


def test_floors(plain):
    inputs, _ = plain["omni"]
    everywhere = simulate(
        OMNI, inputs, 0.02, laws={"surface_change/disc": {"change": 0.3, "x": 0.0, "y": 0.0, "radius": 1e3}}
    )
    rough = OMNI.with_parameters(
        **{name: 1.3 * OMNI.parameters[name] for name in ("Bv", "Bvn", "Bw", "Cv", "Cvn", "Cw")}
    )
    np.testing.assert_allclose(everywhere.speeds, simulate(rough, inputs, 0.02).speeds, atol=1e-9)
    slope = {"ground_slope/two_planes": {"angle": 0.03, "direction": 0.4, "offset": 1e3}}
    plane = simulate(OMNI, inputs, 0.02, {"ground_slope": {"angle": 0.03, "direction": 0.4}})
    np.testing.assert_allclose(simulate(OMNI, inputs, 0.02, laws=slope).speeds, plane.speeds, atol=1e-9)


def test_a_bowl_keeps_the_energy_of_a_free_robot():
    """m v^2 / 2 + m g c r^2 / 2 of a robot that rolls freely from the wall of a bowl."""
    names = ("Bv", "Bvn", "Bw", "Cv", "Cvn", "Cw", "Kt")
    free = OMNI.with_parameters(**dict.fromkeys(names, 0.0))
    run = simulate(
        free, np.zeros((200, 4)), 0.02, laws={"ground_slope/bowl": {"curvature": 0.1}}, start={0: 0.8, 1: -0.3, 4: 0.2}
    )
    x, y, V, Vn = run.states[:, 0], run.states[:, 1], run.states[:, 3], run.states[:, 4]
    energy = 0.5 * (V**2 + Vn**2) + 0.5 * 9.81 * 0.1 * (x**2 + y**2)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-7)
    assert np.ptp(x) > 1.0


def test_turning_friction_only_takes_energy():
    free = PIONEER.with_parameters(Cs=0.0, Cv=0.0, Cs1=0.0, Cv1=0.0, KT=0.0, KE=0.0, tau_fr=0.0)
    for law in ("coulomb_viscous", "scrub", "drawn"):
        run = simulate(
            free, np.zeros((100, 2)), 0.02, laws={f"turning_friction/{law}": {"moment": 0.4}}, start={4: 0.3, 5: 2.0}
        )
        assert run.speeds[-1, 1] < 1.0 and run.speeds[:, 1].min() > -1e-3


def test_a_freewheeling_driver_does_not_brake():
    coasting = OMNI.with_parameters(Bv=0.0, Cv=0.0)
    held, free = (
        simulate(coasting, np.zeros((50, 4)), 0.02, laws=laws, start={3: 1.0}).speeds[-1, 0]
        for laws in (None, {"freewheeling_driver/below": {"threshold": 0.1}})
    )
    assert free == pytest.approx(1.0) and held < 0.8


def test_heat():
    """A blocked motor warms by u^2 / R; with the torque constant falling, its torque does."""
    blocked = PIONEER.with_parameters(Cs=1e3)
    place = PIONEER.n_states + 3 * 2
    run = simulate(blocked, np.full((101, 2), 3.0), 0.02, laws={"motor_heating/torque_constant": {"coefficient": 1e-3}})
    np.testing.assert_allclose(run.states[:, place], 9.0 / 0.71 * run.t, rtol=1e-7)
    run = simulate(
        blocked, np.full((101, 2), 3.0), 0.02, laws={"motor_heating/cooling": {"coefficient": 1e-9, "time": 0.5}}
    )
    np.testing.assert_allclose(run.states[:, place], 9.0 / 0.71 * 0.5 * (1 - np.exp(-run.t / 0.5)), rtol=1e-6)


def test_bristles_bend_before_they_slide():
    """LuGre: a spring of stiffness Cs / distance at first, and the Stribeck curve for steady sliding."""
    e = vector("axis", "stribeck_friction/lugre", amplitude=4.0, speed=0.05, distance=0.002)
    for s, y in ((1e-4, 0.0), (0.04, 0.3), (-0.3, -0.9)):
        level, xdot = np.full((2, 1), 12.0), np.zeros(1)
        force = bristles(8.0, s, 0, np.array([y]), xdot, 0, e, level)
        assert xdot[0] == pytest.approx((s - abs(s) * y * 8.0 / 12.0) / 0.002)
        assert force == pytest.approx(8.0 * (y + 0.03 * xdot[0])) and not level.any()
    robot = AXIS.with_parameters(J=20.0, k=10.0, Cv=30.0, Cs=8.0)
    law = {"stribeck_friction/lugre": {"amplitude": 4.0, "speed": 0.05, "distance": 0.002}}
    held = simulate(robot, np.full((500, 1), 0.4), 0.02, laws=law)  # 4 N of the 8 N that it takes to slide
    assert abs(held.speeds[-1, 0]) < 1e-4 and 0.0 < held.states[-1, 0] < 0.002
    sliding, plain = (simulate(robot, np.full((1500, 1), 2.0), 0.02, laws=own).speeds[-1, 0] for own in (law, None))
    assert sliding == pytest.approx(plain, abs=1e-3)  # 20 N = 30 v + 8 N, far above the Stribeck speed


def test_a_creeping_wheel_turns_faster_than_the_floor_passes():
    """At a steady speed the motor's back-EMF is that of a wheel that is faster by creep * force * (speed + 5 cm/s)."""
    creep = 0.01
    run = simulate(PIONEER, np.full((1000, 2), 5.0), 0.02, laws={"traction_limit/creep": {"creep": creep}})
    p, v = PIONEER.parameters, run.speeds[-1, 0]
    force = (p["Cs"] + p["tr"] * p["mu"] * p["tau_fr"] + p["Cv"] * v / p["R"]) / p["R"]  # a wheel's
    current = force * p["R"] / (p["tr"] * p["mu"] * p["KT"])
    rate = (v + creep * force * (v + 0.05)) / p["R"]
    assert p["Ra"] * current + p["KE"] * p["tr"] * rate == pytest.approx(5.0, rel=1e-3)


def test_payloads():
    """A frictionless axis under a constant force: m v = F t; with mass (J + m(t)) v' = F where it leaks."""
    free = AXIS.with_parameters(J=2.0, Cs=0.0, Cv=0.0)
    force = np.full((101, 1), 3.0)
    carried = simulate(free, force, 0.02, laws={"payload_change/in_some_logs": {"mass": 1.0}})
    np.testing.assert_allclose(carried.speeds[:, 0], carried.t, atol=1e-9)
    leaking = simulate(free, force, 0.02, laws={"payload_change/leaking": {"mass": 1.0, "time": 4.0}})
    np.testing.assert_allclose(leaking.speeds[:, 0], -12.0 * np.log(1 - leaking.t / 12.0), atol=1e-7)


def test_diodes_do_not_brake():
    current = {}
    for share in (0.0, 1.0):
        e = vector("pioneer", "freewheeling_driver/no_braking", share=share)
        drive, x = np.zeros(2), np.zeros(30)
        if share == 0.0:
            e[K.strength : K.strength + 4] = e[K.resistance : K.resistance + 4] = 1.0
        motor_drives(np.array([1.0, 3.0]), np.array([4.0, 4.0]), 0.5, 1.0, 1.0, 0.1, 2, x, np.zeros(30), 0, e, drive)
        current[share] = drive.copy()
    np.testing.assert_allclose(current[0.0], [-1.0, 1.0])
    np.testing.assert_allclose(current[1.0], [0.0, 1.0])


def test_play():
    u = np.array([0.0, 0.4, 1.0, 2.0, 1.6, 1.0, 0.0, -3.0])[:, None]
    followed = commanded(u, {"backlash/command": {"width": 1.0}})
    np.testing.assert_allclose(followed[:, 0], [0, 0, 0.5, 1.5, 1.5, 1.5, 0.5, -2.5])


def test_one_wheels_radius():
    plain = PIONEER.parameters["R"]
    inputs = experiment("pioneer", "steps", 100, 1)
    run = simulate(PIONEER, inputs, 0.02, laws={"wheel_radius_mismatch/one_wheel": {"mismatch": 0.05, "wheel": 2}})
    R = 1.025 * plain
    both = {"wheel_radius_mismatch": {"mismatch": -0.05 / 1.025}}
    same = simulate(PIONEER.with_parameters(R=R), inputs, 0.02, both)
    np.testing.assert_array_equal(run.speeds, same.speeds)
    assert R * (1 + 0.5 * 0.05 / 1.025) == pytest.approx(1.05 * plain)
    assert R * (1 - 0.5 * 0.05 / 1.025) == pytest.approx(plain)


def test_a_turned_sensor_keeps_the_speed():
    v = np.array([[0.5, -2.0, 0.3]])
    turned = sensed(v, np.zeros(1), {"sensor_cross_talk/rotated": {"angle": 0.2}})
    assert np.hypot(*turned[0, :2]) == pytest.approx(np.hypot(0.5, 2.0)) and turned[0, 2] == 0.3


def test_what_is_wrong_is_refused():
    inputs = np.zeros((3, 1))
    with pytest.raises(ValueError, match="Unknown law 'magic'"):
        simulate(AXIS, inputs, 0.02, laws={"magic": {}})
    with pytest.raises(ValueError, match="no parameter .'size'."):
        simulate(AXIS, inputs, 0.02, laws={"traction_limit/tanh": {"size": 1.0}})
    with pytest.raises(ValueError, match="does not apply to the robot 'axis'"):
        simulate(AXIS, inputs, 0.02, laws={"effective_track/wider": {"share": 0.1}})
    with pytest.raises(ValueError, match="no number 3; there are 2"):
        simulate(
            PIONEER, np.zeros((3, 2)), 0.02, laws={"motor_gain_mismatch/torque_constant": {"mismatch": 0.1, "motor": 3}}
        )
    assert len(vector("axis", "traction_limit/tanh", inverse_limit=0.1)) == LENGTH
    assert K.sensor_second + 3 == LENGTH
