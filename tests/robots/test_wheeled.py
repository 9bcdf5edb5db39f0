"""Robots on any wheels against mechanics in world coordinates with rolling constraints, and against robots of their own."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import DifferentialDrive, LayoutError, Log, LogSet, Omni, Wheel, Wheeled, output_error, simulate
from jaxid._float64 import float64
from jaxid.effects import catalogue, effect_by_id, laws_of

KIWI = (
    Wheel("front", (0.2, 0.0), 90, "omni"),
    Wheel("left", (-0.1, 0.1732), 210, "omni"),
    Wheel("right", (-0.1, -0.1732), 330, "omni"),
)
PLACES = {"fl": (0.2, 0.15), "fr": (0.2, -0.15), "rl": (-0.2, 0.15), "rr": (-0.2, -0.15)}
MECANUM = tuple(Wheel(name, at, 0, "mecanum") for name, at in PLACES.items())
SKID = tuple(Wheel(name, at, 0, "skid", command=f"u_{name[1]}") for name, at in PLACES.items())
CART = (Wheel("right", (-0.1, -0.2), 180), Wheel("left", (-0.1, 0.25)))
ASKEW = (Wheel("a", (0.1, -0.2), 30), Wheel("b", (-0.1, 0.146410161513775), 30))  # an axle that lies across
LAYOUTS = {"kiwi": KIWI, "mecanum": MECANUM, "skid": SKID, "cart": CART, "askew": ASKEW}


def turned(angle):
    return jnp.array([[jnp.cos(angle), -jnp.sin(angle)], [jnp.sin(angle), jnp.cos(angle)]])


def constrained(wheels, state, torques, resisting, turning, p):
    """Accelerations (V', Vn', W') of the body, the wheels' speeds, and how they slip, in world coordinates
    q = (x, y, theta, phi ...): the derivatives of the kinetic energy, and Lagrange multipliers of what rollers and rubber keep
    from slipping."""
    radii = [p["r"] * (1.0 - np.sign(w.at[1]) * p["radius_mismatch"]) for w in wheels]

    def energy(q, rate):
        com = rate[:2] + rate[2] * turned(q[2] + jnp.pi / 2) @ jnp.array([p["xc"], p["yc"]])
        return 0.5 * (p["M"] * com @ com + p["J"] * rate[2] ** 2 + p["Iw"] * rate[3:] @ rate[3:])

    def slip(q, rate):
        found, skid = [], [w for w in wheels if w.kind == "skid"]
        for k, (w, radius) in enumerate(zip(wheels, radii, strict=True)):
            roll, roller = q[2] + w.forward, q[2] + w.forward + w.tilt
            contact = rate[:2] + rate[2] * turned(q[2] + jnp.pi / 2) @ jnp.array(w.at)
            ground = contact - radius * rate[3 + k] * jnp.array([jnp.cos(roll), jnp.sin(roll)])
            found.append(ground @ jnp.array([jnp.cos(roller), jnp.sin(roller)]))
            if w.kind == "standard":
                found.append(ground @ jnp.array([-jnp.sin(roll), jnp.cos(roll)]))
        if skid:
            middle = jnp.mean(jnp.array([w.at for w in skid]), axis=0)
            contact = rate[:2] + rate[2] * turned(q[2] + jnp.pi / 2) @ middle
            found.append(contact @ jnp.array([-jnp.sin(q[2]), jnp.cos(q[2])]))
        return jnp.stack(found)

    V, Vn, W = state["V"], state["Vn"], state["W"]
    count, theta = len(wheels), 0.7
    q = jnp.zeros(3 + count).at[2].set(theta)
    # Wheels' rates that do not slip.
    C0 = jax.jacfwd(slip, argnums=1)(q, jnp.zeros(3 + count))
    body = jnp.concatenate([turned(theta) @ jnp.array([V, Vn]), jnp.array([W])])
    phi = jnp.linalg.lstsq(C0[:, 3:], -C0[:, :3] @ body)[0]
    rate = jnp.concatenate([body, phi])
    inertia = jax.hessian(energy, argnums=1)(q, rate)
    momentum = lambda q: jax.grad(energy, argnums=1)(q, rate)  # noqa: E731
    bias = jax.grad(energy)(q, rate) - jax.jvp(momentum, (q,), (rate,))[1]
    forces = jnp.zeros(3 + count).at[3:].set(jnp.array(torques) - jnp.array(resisting)).at[2].set(-turning)
    C = jax.jacfwd(slip, argnums=1)(q, rate)
    drift = jax.jvp(lambda q: slip(q, rate), (q,), (rate,))[1]
    n = len(C)
    full = jnp.block([[inertia, -C.T], [C, jnp.zeros((n, n))]])
    found = jnp.linalg.lstsq(full, jnp.concatenate([forces + bias, -drift]))[0][: 3 + count]
    straight = turned(theta).T @ found[:2]
    return jnp.stack([straight[0] + W * Vn, straight[1] - W * V, found[2]]), phi, slip(q, rate)


@pytest.mark.parametrize(
    "layout",
    [pytest.param(name, marks=pytest.mark.slow) if name in ("kiwi", "cart", "askew") else name for name in LAYOUTS],
)
def test_it_obeys_lagrange_with_wheels_that_roll(layout):
    wheels, rng = LAYOUTS[layout], np.random.default_rng(3)
    robot = Wheeled(wheels=wheels)
    in_world = jax.jit(partial(constrained, wheels))
    with float64():
        for _ in range(3):
            p = {
                **robot.parameters.numbers,
                "M": rng.uniform(2, 30),
                "J": rng.uniform(0.05, 1),
                "Iw": rng.uniform(0, 0.05),
            }
            p |= {"xc": rng.uniform(-0.2, 0.2), "yc": rng.uniform(-0.1, 0.1), "r": rng.uniform(0.03, 0.1)}
            p["radius_mismatch"] = rng.uniform(-0.1, 0.1) if "radius_mismatch" in str(robot.mechanisms) else 0.0
            own = dict(zip(robot.velocities, rng.normal(size=3), strict=False))
            V, Vn, W = robot.planar(own, p)
            u = dict(zip(robot.channels.inputs, rng.normal(size=4), strict=False))
            dry = tuple(rng.normal(size=len(robot.rubbing(own, p))))
            speeds = robot.rubbing(own, p)
            resisting = [p["viscous"] * s + d for s, d in zip(speeds, dry, strict=True)][: len(wheels)]
            turning = p["Bw"] * W + dry[-1] if robot.scrubs else 0.0
            torques = [u[w.input] for w in wheels]
            expected, phi, slipping = in_world({"V": V, "Vn": Vn, "W": W}, torques, resisting, turning, p)
            np.testing.assert_allclose(slipping, 0.0, atol=1e-12)
            np.testing.assert_allclose(speeds[: len(wheels)], phi, rtol=1e-9)
            rates = robot.rates(own, tuple(u.values()), dry, p)
            np.testing.assert_allclose(robot.planar(rates, p), expected, rtol=1e-8, atol=1e-10)
            general = super(Wheeled, robot).compliance(own, p)
            np.testing.assert_allclose(robot.compliance(own, p), general, rtol=1e-9, atol=1e-12)


def test_four_wheels_across_are_the_omni():
    b, rng = 0.195, np.random.default_rng(5)
    four = ((b, 0.0), 90), ((0.0, b), 180), ((-b, 0.0), 270), ((0.0, -b), 0)
    robot = Wheeled(wheels=tuple(Wheel(f"w{k}", at, a, "omni") for k, (at, a) in enumerate(four)), motors=True)
    omni = Omni().with_values(Bv=0.0, Bvn=0.0, Bw=0.0, xc=0.03, yc=-0.02)
    q, p = omni.parameters.numbers, {**robot.parameters.numbers, "viscous": 0.0, "xc": 0.03, "yc": -0.02}
    p |= {"M": q["M"], "J": q["J"], "r": q["r"], "K": q["Kt"], "Ra": q["Ra"], "gear": q["l"], "supply": q["supply"]}
    with float64():
        for _ in range(5):
            state = dict(zip(("V", "Vn", "W"), rng.normal(size=3), strict=True))
            u = tuple(rng.uniform(-30, 30, 4))  # beyond the supply, too
            mine, its = robot.rates(state, u, (0.0,) * 4, p), omni.rates(state, u, (0.0,) * 3, q)
            np.testing.assert_allclose([mine[n] for n in state], [its[n] for n in state], rtol=1e-10)
            np.testing.assert_allclose(robot.currents(state, u, p), omni.currents(state, u, q), rtol=1e-10)


def test_without_forces_it_keeps_its_energy():
    robot = Wheeled(wheels=MECANUM).with_values(viscous=0.0, coulomb=0.0, xc=0.08, yc=0.05, Iw=0.003)
    time = np.arange(0, 2, 0.01)
    log = LogSet([Log("coasting", time, np.zeros((len(time), 4)), np.zeros((len(time), 3)), robot.channels)])
    with float64():
        moved = simulate(robot, log, start={"V": np.array([1.0]), "Vn": np.array([-0.5]), "W": np.array([4.0])})[0]
    p, (V, Vn, W) = robot.parameters.numbers, moved.T
    wheels = np.array([robot.rubbing(dict(zip(robot.velocities, row, strict=True)), p) for row in moved])
    com = (V - W * p["yc"]) ** 2 + (Vn + W * p["xc"]) ** 2
    energy = 0.5 * (p["M"] * com + p["J"] * W**2 + p["Iw"] * (wheels**2).sum(axis=1))
    np.testing.assert_allclose(energy, energy[0], rtol=1e-6)
    assert np.ptp(V) > 0.1  # it turns on, and its speed ahead with it


def test_wheels_that_cannot_move_it_are_refused():
    def refused(*wheels):
        with pytest.raises(LayoutError) as error:
            Wheeled(wheels=wheels)
        return str(error.value)

    assert "kind = 'skid'" in refused(*(Wheel(n, at) for n, at in PLACES.items()))
    assert "sideways" in refused(*(Wheel(n, at, 0, "omni") for n, at in PLACES.items()))
    assert "turning" in refused(Wheel("one", (0.0, 0.0)))
    assert "two wheels are called a" in refused(Wheel("a", (0.0, 0.1)), Wheel("a", (0.0, -0.1)))
    assert "at least one" in refused()
    with pytest.raises(LayoutError, match="drives nothing"):
        Wheel("a", (0.0, 0.1), 0, "mecanum", rollers=90)
    with pytest.raises(LayoutError, match="letters"):
        Wheel("front left", (0.0, 0.1))
    with pytest.raises(LayoutError, match="use one of standard"):
        Wheel("a", (0.0, 0.1), 0, "caster")  # type: ignore[arg-type]
    with pytest.raises(LayoutError, match="make it mecanum"):
        Wheel("a", (0.0, 0.1), 0, "omni", rollers=45)


def test_its_commands_and_columns():
    skid, kiwi = Wheeled(wheels=SKID), Wheeled(wheels=KIWI, motors=True)
    assert skid.channels.inputs == ("u_l", "u_r") and skid.channels.outputs == ("v", "w")
    assert kiwi.channels.units["u_front"] == "V" and skid.channels.units["u_l"] == "N m"
    speeds, angles = ("speed_front", "speed_left", "speed_right"), ("angle_front", "angle_left", "angle_right")
    assert kiwi.for_columns(("t", *speeds)).channels.outputs == speeds
    by_angles = kiwi.for_columns(("t", *angles))
    assert by_angles.measured_angles == angles and by_angles.channels.stand_ins("V") == angles
    both = kiwi.for_columns(("t", *speeds, "V", "Vn", "W"))
    assert both.channels.outputs == ("V", "Vn", "W")
    assert Wheeled(wheels=SKID).driving_modes["forwards"] == (1.0, 1.0)
    assert Wheeled(wheels=MECANUM).driving_modes["sideways"] == (-1.0, 1.0, 1.0, -1.0)
    assert "torques" in skid.said_of_commands and not kiwi.said_of_commands


def test_what_may_be_missing_of_it():
    ids = {name: {e.id for e in catalogue(Wheeled(wheels=own))} for name, own in LAYOUTS.items()}
    for found in ids.values():
        assert {"stribeck_friction", "ground_slope", "backlash", "effective_track", "payload_change"} <= found
    assert "wheel_radius_mismatch" in ids["kiwi"] and "sideways_friction" in ids["kiwi"]
    assert "forward_com_offset" in ids["skid"] and "forward_com_offset" not in ids["kiwi"]
    motors = {e.id for e in catalogue(Wheeled(wheels=KIWI, motors=True))}
    assert {"battery_sag", "motor_heating", "freewheeling_driver"} <= motors


def moved_kiwi(mismatch=0.0, seeds=(1, 2), slope=0.0):
    """A kiwi of its own equations, in world coordinates, with wheels that stick: small steps, and the friction of all three
    wheels together by sweeps."""
    m, J, K, Ra, gear, Iw, viscous, dry = 5.2, 0.061, 0.025, 0.6, 12.0, 0.004, 0.012, 0.09
    radii = 0.05 * np.array([1.0, 1.0 - mismatch, 1.0 + mismatch])
    heads, at = np.radians([90, 210, 330]), np.array([w.at for w in KIWI])
    A = (
        np.stack([np.cos(heads), np.sin(heads), at[:, 0] * np.sin(heads) - at[:, 1] * np.cos(heads)], 1)
        / radii[:, None]
    )
    inverse = np.linalg.inv(np.diag([m, m, J]) + Iw * A.T @ A)
    D, per = A @ inverse @ A.T, 5e-4
    # Back-EMF and viscous friction within a step by their matrix exponential: an Euler step would change the inertia seen.
    damp = inverse @ A.T @ A * ((gear * K) ** 2 / Ra + viscous)
    values, vectors = np.linalg.eig(damp)
    decay = (vectors * np.exp(-values * per)) @ np.linalg.inv(vectors)
    gain = np.linalg.solve(damp, np.eye(3) - decay.real)
    logs = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        levels, v, theta, rows = rng.uniform(-6, 6, (20, 3)), np.zeros(3), 0.0, []
        for k in range(800):
            u = levels[k // 40]
            rows.append([*u, *v])
            for _ in range(20):
                turning = np.array([m * v[2] * v[1], -m * v[2] * v[0], 0.0])
                pull = m * 9.81 * np.sin(slope) * np.array([-np.cos(theta), np.sin(theta), 0.0])
                free = decay.real @ v + gain @ inverse @ (A.T @ (gear * K * u / Ra) + turning + pull)
                held = np.zeros(3)
                for _ in range(6):
                    for i in range(3):
                        slip = A[i] @ free - per * D[i] @ held
                        held[i] = np.clip(held[i] + slip / (per * D[i, i]), -dry, dry)
                v, theta = free - per * inverse @ A.T @ held, theta + per * v[2]
        logs.append(np.array(rows))
    return logs


def kiwi_logs(robot, **moved):
    rng, logs = np.random.default_rng(9), []
    for k, rows in enumerate(moved_kiwi(**moved)):
        outputs = rows[:, 3:] + rng.normal(0, (0.004, 0.004, 0.01), (len(rows), 3))
        logs.append(Log(f"run_{k}", 0.01 * np.arange(len(rows)), rows[:, :3], outputs, robot.channels))
    return LogSet(logs)


@pytest.mark.slow
def test_a_kiwi_of_its_own_equations_is_identified():
    robot = Wheeled(wheels=KIWI, motors=True).with_values(K=0.025, Ra=0.6, gear=12.0, supply=12.0, Iw=0.004)
    fit = output_error(robot, kiwi_logs(robot))
    assert fit.converged and fit.trustworthy
    for name, true in {"M": 5.2, "J": 0.061, "viscous": 0.012, "coulomb": 0.09}.items():
        assert abs(fit[name].value - true) < 4 * fit[name].std_error, name
        assert fit[name].std_error < 0.02 * true, name


@pytest.mark.slow
def test_a_wheel_radius_that_differs_is_found_by_its_own_parameter():
    robot = Wheeled(wheels=KIWI, motors=True).with_values(K=0.025, Ra=0.6, gear=12.0, supply=12.0, Iw=0.004)
    robot = robot + effect_by_id(robot, "wheel_radius_mismatch")
    fit = output_error(robot, kiwi_logs(robot, mismatch=0.03, seeds=(1,)))
    assert abs(fit["radius_mismatch"].value - 0.03) < 4 * fit["radius_mismatch"].std_error < 0.004


def test_two_wheels_are_the_differential_drive():
    rng = np.random.default_rng(7)
    robot = Wheeled(wheels=(Wheel("right", (0.0, -0.2)), Wheel("left", (0.0, 0.2))))
    drive = DifferentialDrive()
    p = {**robot.parameters.numbers, "r": 0.1, "xc": 0.05, "yc": 0.03, "radius_mismatch": 0.04}
    q = {**drive.parameters.numbers, "xc": 0.05, "yc": 0.03, "radius_mismatch": 0.04, "Fv": p["viscous"] / 0.01}
    with float64():
        for _ in range(5):
            state = {"v": rng.normal(), "w": rng.normal()}
            u, dry = rng.normal(size=2), rng.normal(size=2)
            mine = robot.rates(state, tuple(0.1 * u), tuple(0.1 * dry), p)
            its = drive.rates(state, tuple(u), tuple(dry), q)
            np.testing.assert_allclose([mine["v"], mine["w"]], [its["v"], its["w"]], rtol=1e-10)


@pytest.mark.parametrize("wheels", [SKID, (*SKID, Wheel("out", (0.0, 0.4), 0, "skid", command="u_l"))])
def test_wheels_that_share_a_command_are_as_those_with_the_same_command_each(wheels):
    """Also where one of them turns quicker than the others; a supply drops by the current of them all."""
    shared, rng = Wheeled(wheels=wheels, motors=True), np.random.default_rng(3)
    apart = Wheeled(wheels=tuple(replace(wheel, command="") for wheel in wheels), motors=True)
    models = [(shared, apart), tuple(robot + effect_by_id(robot, "battery_sag") for robot in (shared, apart))]
    p = {**apart.parameters.numbers, "Iw": 0.02, "gear": 20.0, "xc": 0.03, "battery_sag.resistance": 0.1}
    with float64():
        for together, each in models:
            for _ in range(3):
                state, (left, right) = dict(zip(("v", "w"), rng.normal(size=2), strict=True)), rng.uniform(-20, 20, 2)
                u, dry = tuple(left if w.input == "u_l" else right for w in wheels), (0.0,) * (len(wheels) + 1)
                mine, its = together.rates(state, (left, right), dry, p), each.rates(state, u, dry, p)
                np.testing.assert_allclose([mine[n] for n in state], [its[n] for n in state], rtol=1e-10)


@pytest.mark.parametrize("motors", [False, True])
def test_all_that_may_be_missing_acts_on_wheels_that_share_a_command(motors):
    robot = Wheeled(wheels=SKID, motors=motors, wheel_angles=True, pose=True)
    with float64():
        for law in catalogue(robot):
            for own in laws_of(robot, law.id):
                model = robot + own
                p = {name: value or 0.01 for name, value in model.parameters.numbers.items()}
                state = dict.fromkeys(model.states, 0.1)
                rates = model.rates(state, (2.0, -1.0), (0.0,) * len(model.rubbing(state, p)), p)
                assert all(np.isfinite(float(np.asarray(rates[name]))) for name in ("v", "w")), (law.id, own.law)


def test_a_gyro_beside_the_wheels_speeds_is_measured_too():
    skid, speeds = Wheeled(wheels=SKID), tuple(f"speed_{wheel.name}" for wheel in SKID)
    seen = skid.for_columns(("t", *speeds, "w"))
    assert seen.channels.outputs == (*speeds, "w") and seen.channels.units["w"] == "rad/s"
    assert seen.channels.mixing["w"] == skid.channels.mixing["w"]
    assert skid.for_columns(("t", *speeds)).channels.outputs == speeds
    state, p = {"v": 0.3, "w": -0.7}, seen.parameters.numbers
    assert seen.observe(state, (0.0, 0.0), p) == (*seen.rubbing(state, p)[:4], -0.7)
    drive = DifferentialDrive().for_columns(("t", "v_right", "v_left", "w"))
    q = drive.parameters.numbers
    assert drive.channels.outputs == ("v_right", "v_left", "w")
    assert drive.observe({"v_right": 1.0, "v_left": 0.6}, (0.0, 0.0), q)[2] == pytest.approx(0.4 / (2 * q["b"]))
