"""The missing force against forces that were really there, in logs of the independent simulator and of a closed form."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Log, LogSet, Parameter, Pioneer
from jaxid.effects.actuator import MotorHeating, MotorLag
from jaxid.effects.body import GroundSlope
from jaxid.effects.sensor import SensorBias
from jaxid.explanation.where.missing_force import NoVelocities, _spread, missing_force
from reference import excitation
from reference.logs import simulate_log
from reference.pioneer import PIONEER

NOISE = {"eta1": 0.01, "eta2": 0.02}
KINDS = ("prbs_forward", "arcs", "turning")
PUSH = {"force": 8.0, "moment": 0.0, "start": 3.0, "duration": 0.5, "every": 4.0}
SAMPLES = 600


def true_model(reference=PIONEER) -> Pioneer:
    """The model with the simulator's own constants."""
    robot = Pioneer()
    return robot.with_values(**{n: v for n, v in reference.parameters.items() if n in robot.parameters})


def pioneer_logs(effects=None, reference=PIONEER) -> LogSet:
    logs = []
    for seed, kind in enumerate(KINDS):
        inputs = excitation.experiment("pioneer", kind, SAMPLES, seed)
        table = simulate_log(reference, inputs, 0.02, tuple(NOISE.values()), 50 + seed, effects, rtol=1e-7, atol=1e-9)
        logs.append(
            Log.from_arrays(
                kind,
                table["t"],
                {n: table[n] for n in ("V2", "V3")},
                {n: table[n] for n in NOISE},
                "pioneer",
            )
        )
    return LogSet(logs)


def normalised(forces) -> np.ndarray:
    """Force in units of its own standard deviation, all logs [samples, n]."""
    return np.concatenate([force.force / force.std for force in forces])


@pytest.mark.slow
def test_a_model_that_lacks_nothing_misses_no_force():
    forces = missing_force(true_model(), pioneer_logs())
    z = normalised(forces)
    assert np.mean(z**2) < 1.2
    assert np.mean(np.abs(z) < 2) > 0.93
    assert forces[0].names == ("eta1", "eta2") and forces[0].units == ("N", "N m")
    # A force that changed the speed by its noise within 0.1 s would have been seen by far.
    assert np.max([np.median(force.std / force.scale) for force in forces]) < 0.2


def test_a_push_is_found_when_it_came_and_as_strong_as_it_was():
    logs = pioneer_logs({"push": PUSH})
    found = []
    for force in missing_force(true_model(), logs):
        since = (force.time - PUSH["start"]) % PUSH["every"]
        pushed = (force.time >= PUSH["start"]) & (since < PUSH["duration"])
        inside = (force.time >= PUSH["start"]) & (since > 0.15) & (since < PUSH["duration"] - 0.15)
        away = (since > PUSH["duration"] + 0.6) & (since < PUSH["every"] - 0.6)
        for start in np.arange(PUSH["start"], 11.0, PUSH["every"]):
            near = (force.time > start - 0.6) & (force.time < start + PUSH["duration"] + 0.6)
            found.append(float(np.sum(force.force[near, 0]) * 0.02))
        error = (force.force[:, 0] - np.where(pushed, PUSH["force"], 0.0)) / force.std[:, 0]
        # Inside its own band in the middle of a push and far from one; a random walk rounds the edges off.
        assert np.mean(np.abs(error[inside | away]) < 2) > 0.9
        assert np.mean(force.force[inside, 0]) == pytest.approx(PUSH["force"], rel=0.15)
        assert np.mean(np.abs(force.force[:, 1] / force.std[:, 1]) < 2) > 0.9  # nothing turned the robot
    assert len(found) == 6
    np.testing.assert_allclose(found, PUSH["force"] * PUSH["duration"], rtol=0.15)
    assert np.mean(found) == pytest.approx(PUSH["force"] * PUSH["duration"], rel=0.05)


@pytest.mark.slow
def test_a_slope_pulls_with_the_heading():
    slope = {"angle": 0.03, "direction": 0.7}
    logs = pioneer_logs({"ground_slope": slope})
    weight = sum(PIONEER.parameters[n] * k for n, k in (("M", 1), ("m", 2), ("m1", 1))) * 9.81 * np.sin(slope["angle"])
    for log, force in zip(logs, missing_force(true_model(), logs), strict=True):
        heading = np.concatenate([[0.0], np.cumsum(log.output("eta2"))[:-1] * 0.02])
        pull = weight * (-np.sin(heading) * np.cos(slope["direction"]) + np.cos(heading) * np.sin(slope["direction"]))
        gain = float(force.force[:, 0] @ pull / (pull @ pull))
        assert gain == pytest.approx(1.0, abs=0.1)
        assert np.corrcoef(force.force[:, 0], pull)[0, 1] > 0.95


@pytest.mark.slow
def test_effects_of_the_model_are_accounted_for():
    hidden = {
        "ground_slope": {"angle": 0.03, "direction": 0.7},
        "motor_lag": {"time_constant": 0.06},
        "motor_heating": {"coefficient": 5e-4},
        "sensor_bias": {"bias": 0.05, "channel": 1.0},
    }
    # A slope of the model pulls at the body alone, that of the simulator at the wheels as well: make them light.
    light = PIONEER.with_parameters(m=1e-4, m1=1e-4)
    bare = true_model(light)
    full = bare + GroundSlope() + MotorLag() + MotorHeating() + SensorBias()
    full = full.with_values(
        **{
            "ground_slope.slope_x": np.sin(0.03) * np.cos(0.7),
            "ground_slope.slope_y": np.sin(0.03) * np.sin(0.7),
            "motor_lag.time_constant": 0.06,
            "motor_heating.coefficient": 5e-4,
            "sensor_bias.bias_eta1": 0.05,
        }
    )
    z = normalised(missing_force(full, pioneer_logs(hidden, light)))
    assert np.mean(z**2) < 1.3
    # The slope alone would be missed by far if the model's effects did not reach the filter (see the test above).
    assert np.mean(np.abs(z) < 2) > 0.92


def axis_model(**values) -> Axis:
    return Axis().with_values(**({"M": 1.0, "Fv": 2.0, "Fc": 0.5, "offset": 0.0} | values))


def test_nothing_is_known_of_a_force_while_everything_stands_still(axis_log):
    inputs = np.concatenate([np.full(150, 2.0), np.zeros(200), np.full(150, 2.0)])
    hidden = np.repeat([0.0, 0.6, 0.0, 0.3, 0.3, 0.3, 0.3, 0.6, 0.0, -0.6], 50)  # 0.3 N do not break the axis away
    log = axis_log("rest", inputs + hidden, noise=0.01, position=False)
    (force,) = missing_force(axis_model(), LogSet([replace(log, inputs=inputs[:, None])]))
    at_rest, driving = (force.time > 4.5) & (force.time < 6.5), (force.time > 0.5) & (force.time < 2.5)
    assert force.std[at_rest].min() > 1.5 * np.median(force.std[driving])
    assert np.all(np.abs(force.force[at_rest, 0] - hidden[at_rest]) < 2 * force.std[at_rest, 0])
    assert np.all(np.abs(force.force[at_rest]) < 0.5)  # more would have moved it
    assert np.mean(force.force[70:90]) == pytest.approx(0.6, abs=0.1)


def test_a_model_that_sticks_while_the_robot_moves_still_finds_the_force(axis_log):
    # The robot rubs with 0.5 N and moves at 0.8 N; the model's 1.0 N would hold it. Missing while it moves: 0.5 N.
    inputs = np.concatenate([np.zeros(50), np.full(450, 0.8)])
    (force,) = missing_force(axis_model(Fc=1.0), LogSet([axis_log("creep", inputs, noise=0.01, position=False)]))
    steady = force.time > 4.0
    assert np.mean(force.force[steady]) == pytest.approx(0.5, abs=0.03)
    assert np.mean(np.abs(force.force[steady, 0] - 0.5) < 2 * force.std[steady, 0]) > 0.95


def drift(state, u, p):
    """A body in a viscous fluid, without the current of 0.3 N that pushes the real one."""
    return {"speed": (u["drive"] - p["drag"] * state["speed"]) / p["mass"]}


def test_a_users_own_robot_misses_an_acceleration():
    channels = Channels(inputs=("drive",), outputs=("speed",), units={"speed": "m/s"})
    table = {"mass": Parameter(2.0, "kg"), "drag": Parameter(1.0, "N s/m", free=True)}
    robot = Custom(dynamics=drift, state_names=("speed",), own_channels=channels, table=table, title="boat")
    rng = np.random.default_rng(3)
    drive = np.repeat(rng.choice([-1.0, 1.0], 20), 25)
    speed = np.zeros(500)
    for k in range(499):  # exact for held input
        final = drive[k] + 0.3
        speed[k + 1] = final + (speed[k] - final) * np.exp(-0.02 / 2.0)
    measured = speed + 0.01 * rng.normal(size=500)
    log = Log.from_arrays("boat", np.arange(500) * 0.02, drive[:, None], {"speed": measured}, channels)
    (force,) = missing_force(robot, LogSet([log]))
    assert force.units == ("m/s/s",)
    assert np.mean(force.force) == pytest.approx(0.15, abs=0.02)  # 0.3 N on 2 kg
    hidden = Channels(inputs=("drive",), outputs=("height",))
    blind = Custom(
        dynamics=drift,
        state_names=("speed",),
        own_channels=hidden,
        table=table,
        output=lambda s, u, p: {"height": s["speed"]},
        title="balloon",
    )
    other = Log.from_arrays("balloon", log.time, drive[:, None], {"height": measured}, hidden)
    with pytest.raises(NoVelocities, match="balloon.*velocities"):
        missing_force(blind, LogSet([other]))


def test_a_state_that_shows_at_some_speed_only_leaves_the_force_a_number():
    """At standstill a tricycle's yaw rate is noise, whatever the steering angle: outputs alone would have it anywhere."""
    robot = Custom(
        dynamics=lambda s, u, p: {"v": (u["drive"] - 2.0 * s["v"]) / p["mass"], "angle": (u["steer"] - s["angle"]) / 0.1},
        output=lambda s, u, p: {"front": s["v"], "yaw": s["v"] * jnp.sin(s["angle"])},
        state_names=("v", "angle"), velocities=("v",), forces={"v": "mass"}, title="tricycle",
        own_channels=Channels(inputs=("drive", "steer"), outputs=("front", "yaw"), units={"drive": "N", "steer": "rad"}),
        table={"mass": Parameter(1.0, "kg", free=True)},
    )  # fmt: skip
    time = 0.02 * np.arange(300)
    going = np.maximum(time - 2.0, 0.0)
    v, angle = 1.0 - np.exp(-2.0 * going), 0.3 * (1.0 - np.exp(-going / 0.1))
    inputs = np.where(time[:, None] < 1.99, 0.0, [2.0, 0.3])
    logs = []
    for seed in range(3):
        noise = 0.01 * np.random.default_rng(seed).normal(size=(300, 2))
        outputs = np.stack([v, v * np.sin(angle)], axis=1) + noise
        logs.append(Log.from_arrays(f"run {seed}", time, inputs, outputs, robot.channels))
    for force in missing_force(robot, LogSet(logs)):
        assert np.isfinite(force.force).all() and np.isfinite(force.std).all()
        assert np.all(np.abs(force.force) < 4 * force.std + 0.05)


def test_the_spread_of_a_state_is_not_that_of_values_far_off():
    values = np.random.default_rng(0).normal(size=600)
    assert _spread(values) == np.std(values)
    assert _spread(np.where(np.arange(600) % 20 == 0, 1e12 * values, values)) < 3.0
    assert _spread(np.where(np.arange(600) < 5, 1.0, 0.0)) > 0.0


@pytest.mark.parametrize("unit", [1e-3, 1e9])
def test_a_missing_force_does_not_hang_on_its_unit(unit):
    """A cart of two kilograms that a constant force pulls, with all forces in so many newtons."""

    def cart(unit):
        return Custom(
            dynamics=lambda s, u, p: {"v": (u["pull"] - p["drag"] * s["v"]) / p["mass"]},
            state_names=("v",), forces={"v": lambda s, p: p["mass"] / unit},
            own_channels=Channels(inputs=("pull",), outputs=("v",), units={"pull": "N", "v": "m/s"}),
            table={"mass": Parameter(2.0, "kg"), "drag": Parameter(1.0, "N s/m", free=True)},
        )  # fmt: skip

    rng, v = np.random.default_rng(3), np.zeros(300)
    pull = np.repeat(rng.choice([-1.0, 1.0], 12), 25)
    for k in range(299):
        v[k + 1] = pull[k] + 0.3 + (v[k] - pull[k] - 0.3) * np.exp(-0.01)
    seen, forces = v + rng.normal(0.0, 0.01, 300), []
    for robot in (cart(1.0), cart(unit)):
        log = Log.from_arrays("cart", 0.02 * np.arange(300), pull[:, None], {"v": seen}, robot)
        forces.extend(missing_force(robot, LogSet([log])))
    own, other = forces
    assert np.mean(own.force) == pytest.approx(0.3, abs=0.04)
    np.testing.assert_allclose(other.force * unit, own.force, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(other.std * unit, own.std, rtol=1e-3)
