"""The omni robot against mechanics derived here by automatic differentiation, analytic motions, a stiff solver and the
independent simulator."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid._float64 import float64
from jaxid.parameters import Parameter
from jaxid.robots import Effect, Omni
from jaxid.robots.omni import body_forces, wheel_speeds
from jaxid.simulation.friction import Sticking
from jaxid.simulation.rollout import Integrator, rollout, step

SPEEDS = ("V", "Vn", "W")
FRICTIONLESS = dict(Bv=0.0, Bvn=0.0, Bw=0.0, Cv=0.0, Cvn=0.0, Cw=0.0)
FREE = FRICTIONLESS | dict(Kt=0.0)


@pytest.fixture(autouse=True)
def double_precision():
    with float64():
        yield


def random_cases(n=30, seed=4):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        state = dict(zip(SPEEDS, rng.normal(size=3), strict=True)) | {"theta": rng.uniform(-3, 3)}
        state |= {"x": rng.normal(), "y": rng.normal()}
        p = {name: value * np.exp(rng.uniform(-0.7, 0.7)) for name, value in Omni().parameters.numbers.items()}
        p |= {"supply": 24.0, "coriolis": 1.0, "xc": rng.uniform(-0.1, 0.1), "yc": rng.uniform(-0.1, 0.1)}
        yield state, tuple(rng.uniform(-24, 24, 4)), tuple(rng.uniform(-20, 20, 3)), p


def traction(state, u, p):
    """Wheel forces from equations 7-9 without inductance, the wheels' speeds from their contact points' geometry."""
    places, directions = (
        p["b"] * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]]),
        np.array([[0, 1], [-1, 0], [0, -1], [1, 0]]),
    )
    forces = []
    for place, direction, volts in zip(places, directions, u, strict=True):
        velocity = np.array([state["V"] - state["W"] * place[1], state["Vn"] + state["W"] * place[0]])
        i = (volts - p["Kv"] * p["l"] * (direction @ velocity) / p["r"]) / p["Ra"]
        forces.append(p["l"] * p["Kt"] * i / p["r"])
    return places, directions, np.array(forces)


def test_wheel_speeds_and_forces_follow_from_the_wheels_places_and_do_the_body_forces_work():
    for state, u, _, p in random_cases():
        places, directions, f = traction(state, u, p)
        expected = [
            d @ [state["V"] - state["W"] * s[1], state["Vn"] + state["W"] * s[0]]
            for s, d in zip(places, directions, strict=True)
        ]
        v = wheel_speeds(state, p)
        np.testing.assert_allclose(v, expected, atol=1e-12)  # equation 12
        body = body_forces(tuple(f), p)
        force = (directions * f[:, None]).sum(axis=0)
        moment = np.sum(places[:, 0] * directions[:, 1] * f - places[:, 1] * directions[:, 0] * f)
        np.testing.assert_allclose(body, [*force, moment], atol=1e-9)  # equations 4-6
        power = body[0] * state["V"] + body[1] * state["Vn"] + body[2] * state["W"]
        np.testing.assert_allclose(f @ np.array(v), power, rtol=1e-10)


def test_uncoupled_robot_has_equations_1_to_3_as_printed():
    assert [Omni().parameters[name].unit for name in ("Bv", "Bw", "Cw")] == ["N s/m", "N m s", "N m"]
    for state, u, dry, p in random_cases():
        p |= {"coriolis": 0.0, "xc": 0.0, "yc": 0.0}
        _, _, (f1, f2, f3, f4) = traction(state, u, p)
        rates = Omni().rates(state, u, dry, p)
        assert rates["V"] * p["M"] == pytest.approx(f4 - f2 - p["Bv"] * state["V"] - dry[0], rel=1e-9)
        assert rates["Vn"] * p["M"] == pytest.approx(f1 - f3 - p["Bvn"] * state["Vn"] - dry[1], rel=1e-9)
        assert rates["W"] * p["J"] == pytest.approx(
            p["b"] * (f1 + f2 + f3 + f4) - p["Bw"] * state["W"] - dry[2], rel=1e-9
        )
    assert Omni().uncoupled().parameters["coriolis"].value == 0.0


@jax.jit
def world_acceleration(state, force, p):
    """Accelerations of (V, Vn, W) from Lagrange's equations for (x, y, theta) with the centre of mass at (xc, yc)."""

    def rotate(angle, vector):
        c, s = jnp.cos(angle), jnp.sin(angle)
        return jnp.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])

    def centre(q):
        return q[:2] + rotate(q[2], jnp.array([p["xc"], p["yc"]]))

    def energy(q, qdot):
        velocity = jax.jvp(centre, (q,), (qdot,))[1]
        return 0.5 * p["M"] * velocity @ velocity + 0.5 * p["J"] * qdot[2] ** 2

    theta = state["theta"]
    q = jnp.array([state["x"], state["y"], theta])
    qdot = jnp.append(rotate(theta, jnp.array([state["V"], state["Vn"]])), state["W"])
    Q = jnp.append(rotate(theta, force[:2]), force[2])
    mass = jax.hessian(energy, 1)(q, qdot)
    moving = jax.jvp(lambda q: jax.grad(energy, 1)(q, qdot), (q,), (qdot,))[1]
    qddot = jnp.linalg.solve(mass, Q - moving + jax.grad(energy, 0)(q, qdot))

    def body(q, qdot):
        return jnp.append(rotate(-q[2], qdot[:2]), qdot[2])

    return jax.jvp(body, (q, qdot), (qdot, qddot))[1]


def test_coupled_robot_obeys_lagranges_equations_with_an_offset_centre_of_mass():
    largest = 0.0
    for state, u, dry, p in random_cases():
        _, directions, f = traction(state, u, p)
        B = np.array([p["Bv"], p["Bvn"], p["Bw"]])
        force = np.append((directions * f[:, None]).sum(axis=0), p["b"] * f.sum())
        force = force - B * [state[name] for name in SPEEDS] - dry
        rates = Omni(pose=True).rates(state, u, dry, p)
        expected = world_acceleration(state, jnp.asarray(force), p)
        np.testing.assert_allclose([rates[name] for name in SPEEDS], expected, rtol=1e-9, atol=1e-9)
        printed = Omni().rates(state, u, dry, p | {"coriolis": 0.0, "xc": 0.0, "yc": 0.0})
        largest = max(largest, *(abs(float(printed[name] - rates[name])) for name in SPEEDS))
    assert largest > 1.0  # the paper's equations are another model as soon as the robot turns while it moves


def test_rotors_take_their_share_of_each_rims_force_and_have_no_momentum_that_turns_with_the_robot():
    """Newton's laws of a body and four rotors: each rim passes on its force less Mr / 2 times its own acceleration."""
    largest = 0.0
    for state, u, dry, p in random_cases(10):
        p["Mr"] = 0.4 * p["M"]
        p["J"] += 2 * p["b"] ** 2 * p["Mr"]
        _, directions, f = traction(state, u, p)
        levers = np.column_stack([directions, np.full(4, p["b"])])  # of each rim, for V, Vn and W
        B = np.array([p["Bv"], p["Bvn"], p["Bw"]])
        force = levers.T @ f - B * [state[name] for name in SPEEDS] - dry
        body = p | {"M": p["M"] - p["Mr"], "J": p["J"] - 2 * p["b"] ** 2 * p["Mr"]}
        at_rest = np.array(world_acceleration(state, jnp.zeros(3), body))
        answers = np.column_stack([world_acceleration(state, jnp.eye(3)[k], body) - at_rest for k in range(3)])
        rotors = p["Mr"] / 2 * levers.T @ levers
        expected = np.linalg.solve(np.eye(3) + answers @ rotors, at_rest + answers @ force)
        rates = Omni(pose=True).rates(state, u, dry, p)
        np.testing.assert_allclose([rates[name] for name in SPEEDS], expected, rtol=1e-9, atol=1e-9)
        whole = Omni(pose=True).rates(state, u, dry, p | {"Mr": 0.0})
        largest = max(largest, *(abs(float(whole[name] - rates[name])) for name in SPEEDS))
    assert largest > 1.0


def test_compliance_is_the_accelerations_answer_to_friction():
    for state, _, _, p in random_cases(5):
        p["Mr"] = 0.3 * p["M"]
        general = super(Omni, Omni()).compliance(state, p)
        np.testing.assert_allclose(
            np.array(Omni().compliance(state, p), float), np.array(general, float), rtol=1e-10, atol=1e-14
        )


def integrate(robot, start, duration):
    """The free motion from `start`, integrated to 1e-12 by SciPy."""
    p, names = robot.parameters.numbers, ("x", "y", "theta", *SPEEDS)

    @jax.jit
    def slope(values):
        rates = robot.rates(dict(zip(names, values, strict=True)), (0.0,) * 4, (0.0,) * 3, p)
        return jnp.stack([jnp.asarray(rates[name], float) for name in names])

    def right(_, values):
        with float64():
            return np.asarray(slope(jnp.asarray(values)))

    y0 = [start.get(name, 0.0) for name in names]
    result = solve_ivp(
        right, (0, duration), y0, method="DOP853", rtol=1e-12, atol=1e-12, t_eval=np.linspace(0, duration, 40)
    )
    return result.t, dict(zip(names, result.y, strict=True))


def momentum(motion, p):
    """Momentum in the world frame [2, T]."""
    a, b = motion["V"] - motion["W"] * p["yc"], motion["Vn"] + motion["W"] * p["xc"]
    c, s = np.cos(motion["theta"]), np.sin(motion["theta"])
    return p["M"] * np.stack([c * a - s * b, s * a + c * b])


def test_free_motion_conserves_energy_and_momentum():
    robot = Omni(pose=True).with_values(**FREE, xc=0.06, yc=-0.04)
    p = robot.parameters.numbers
    _, motion = integrate(robot, {"V": 0.8, "Vn": -0.3, "W": 2.0, "theta": 0.4}, 4.0)
    linear = momentum(motion, p)
    energy = 0.5 * (linear**2).sum(axis=0) / p["M"] + 0.5 * p["J"] * motion["W"] ** 2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    np.testing.assert_allclose(linear, linear[:, :1] + 0 * linear, atol=1e-8)
    # About the world's origin: J W + (x + c) x momentum.
    c, s = np.cos(motion["theta"]), np.sin(motion["theta"])
    x, y = motion["x"] + c * p["xc"] - s * p["yc"], motion["y"] + s * p["xc"] + c * p["yc"]
    angular = p["J"] * motion["W"] + x * linear[1] - y * linear[0]
    np.testing.assert_allclose(angular, angular[0], rtol=1e-9)


def test_printed_equations_turn_the_momentum_with_the_robot():
    robot = Omni(pose=True).with_values(**FREE).uncoupled()
    t, motion = integrate(robot, {"V": 0.8, "Vn": -0.3, "W": 2.0}, 2.0)
    linear = momentum(motion, robot.parameters.numbers)
    angle = np.unwrap(np.arctan2(linear[1], linear[0]))
    np.testing.assert_allclose(angle - angle[0], 2.0 * t, atol=1e-9)


def test_pose_follows_an_analytic_circle():
    robot = Omni(pose=True).with_values(**FREE).uncoupled()  # body speeds stay constant
    V, Vn, W, theta, h = 0.7, -0.4, 1.3, 0.5, 0.01
    state = {"x": 0.1, "y": -0.2, "theta": theta, "V": V, "Vn": Vn, "W": W}
    state = {name: jnp.asarray(value) for name, value in state.items()}
    p = robot.parameters.numbers
    advance = jax.jit(lambda state: step(robot, state, (0.0,) * 4, h, p, Sticking()))
    for _ in range(100):
        state = advance(state)
    end = theta + W * 1.0
    x = 0.1 + (V * (np.sin(end) - np.sin(theta)) + Vn * (np.cos(end) - np.cos(theta))) / W
    y = -0.2 + (-V * (np.cos(end) - np.cos(theta)) + Vn * (np.sin(end) - np.sin(theta))) / W
    np.testing.assert_allclose([state["x"], state["y"], state["theta"]], [x, y, end], atol=1e-9)


def test_inductance_agrees_with_a_stiff_solver():
    """Steps of 10 ms over a current that settles in 0.17 ms, with voltages that jump, and no dry friction."""
    robot = Omni(inductance=True).with_values(Cv=0.0, Cvn=0.0, Cw=0.0)
    p = robot.parameters.numbers
    rng = np.random.default_rng(8)
    volts = np.repeat(rng.uniform(-8, 16, (8, 4)), 10, axis=0)
    dt = np.full(len(volts), 0.01)
    start = robot.initial_state()
    mine = np.asarray(rollout(robot, p, start, jnp.asarray(volts), jnp.asarray(dt), Integrator(1)))

    def right(t, y, u):
        V, Vn, W, i = y[0], y[1], y[2], y[3:]
        rim = np.array([Vn + p["b"] * W, -V + p["b"] * W, -Vn + p["b"] * W, V + p["b"] * W])
        f = p["l"] * p["Kt"] / p["r"] * i
        return np.array([
            (f[3] - f[1] - p["Bv"] * V) / p["M"] + W * Vn,
            (f[0] - f[2] - p["Bvn"] * Vn) / p["M"] - W * V,
            (p["b"] * f.sum() - p["Bw"] * W) / p["J"],
            *((u - p["Ra"] * i - p["Kv"] * p["l"] * rim / p["r"]) / p["La"]),
        ])  # fmt: skip

    exact, y = [np.zeros(7)], np.zeros(7)
    for u in volts[:-1]:
        y = solve_ivp(right, (0, 0.01), y, method="Radau", rtol=1e-9, atol=1e-11, args=(u,)).y[:, -1]
        exact.append(y)
    exact = np.array(exact)
    for j in range(7):
        scale = np.max(np.abs(exact[:, j]))
        assert np.max(np.abs(mine[:, j] - exact[:, j])) < 1e-3 * scale, (
            j,
            np.max(np.abs(mine[:, j] - exact[:, j])) / scale,
        )


def test_supply_limits_the_voltage():
    robot, state = Omni(), dict(V=0.3, Vn=-0.2, W=0.5)
    p = robot.parameters.numbers
    beyond = robot.rates(state, (100.0, -100.0, 25.0, 3.0), (0.0,) * 3, p)
    limit = robot.rates(state, (24.0, -24.0, 24.0, 3.0), (0.0,) * 3, p)
    assert all(float(beyond[name]) == float(limit[name]) for name in SPEEDS)
    currents = robot.observe(state, (100.0, 0.0, 0.0, 0.0), p)[3:]
    assert float(currents[0]) == pytest.approx((24.0 - 6.0 * (-0.2 + 0.195 * 0.5)) / 0.6)


@dataclass(frozen=True)
class Share(Effect):
    """A test effect: the motors get a share of the voltage."""

    id = "share"
    where = "actuator"

    def parameters(self, robot):
        return {self.key("share"): Parameter(0.5)}

    def supply(self, volts, currents, state, p):
        return tuple(p[self.key("share")] * u for u in volts)


def test_effects_on_the_supply_add_up_and_show_in_the_measured_currents():
    state, volts = dict(V=0.0, Vn=0.0, W=0.0), (4.0, -4.0, 8.0, 2.0)
    both, after = Omni() + Share() + Share(), Omni() + Share() + Effect()
    for robot, share in ((both, 0.25), (after, 0.5)):
        p = robot.parameters.numbers
        np.testing.assert_allclose(robot.observe(state, volts, p)[3:], share * np.array(volts) / 0.6)
        half, whole = robot.rates(state, volts, (0.0,) * 3, p), Omni().rates(state, volts, (0.0,) * 3, p)
        assert float(half["W"]) == pytest.approx(share * float(whole["W"]))


def test_rollout_agrees_with_the_independent_simulator():
    """Random voltages that stop, stick and reverse all three axes; the simulator locates every stick and slip event."""
    from reference.logs import simulate as reference_simulate
    from reference.omni import OMNI

    rng = np.random.default_rng(11)
    volts = np.repeat(rng.uniform(-9, 9, (15, 4)), 10, axis=0)
    truth = reference_simulate(OMNI, volts, 0.02)
    assert truth.events > 10
    robot = Omni(pose=True)
    numbers, start = robot.parameters.numbers, robot.initial_state()
    usual = Integrator.suited(robot, 0.02).substeps
    errors = []
    for substeps in (usual, 4 * usual):
        dt = jnp.full(len(volts), 0.02)
        mine = np.asarray(rollout(robot, numbers, start, jnp.asarray(volts), dt, Integrator(substeps)))
        errors.append(np.sqrt(np.mean((mine[:, :3] - truth.speeds) ** 2, axis=0)))
    # A fifth of the demonstration logs' noise (0.01 m/s, 0.01 m/s, 0.02 rad/s) adds 2 % to the normalised RMS.
    assert np.all(errors[0] < 0.2 * np.array([0.01, 0.01, 0.02])), errors
    assert np.all(errors[1] < 0.5 * errors[0]), errors
