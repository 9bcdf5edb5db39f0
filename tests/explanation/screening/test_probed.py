"""What may be missing, simulated together, on a robot without machine code: in one program where effects admit each other."""

import warnings

import jax.numpy as jnp
import numpy as np

from jaxid import Channels, Custom, DriveAxis, Log, LogSet, Parameter, float64
from jaxid.effects import effect_by_id
from jaxid.explanation.screening.probed import probed
from jaxid.explanation.screening.screen import screen
from jaxid.robots.probe import Seen


def dynamics(state, u, p):
    """A cart that is pulled; `sort` has no machine code."""
    pull = u["u"] - p["fv"] * state["v"]
    return {"v": jnp.sort(jnp.stack([pull / p["mass"], 1e6]))[0]}


def test_effects_that_refuse_each_other_are_looked_at_in_programs_of_their_own():
    """Stamps that are early stand beside nothing that makes what is measured late."""
    table = {"mass": Parameter(2.0, "kg", free=True, lower=0.1), "fv": Parameter(4.0, "N s/m", free=True)}
    channels = Channels(inputs=("u",), outputs=("v",), units={"u": "N", "v": "m/s"})
    robot = Custom(dynamics=dynamics, state_names=("v",), own_channels=channels, table=table)
    rng, dt = np.random.default_rng(2), 0.02
    u, v = np.repeat(rng.uniform(-4.0, 4.0, 20), 10), np.zeros(200)
    for k in range(199):
        late = u[max(k - 2, 0)]
        v[k + 1] = late / 4.0 + (v[k] - late / 4.0) * np.exp(-2.0 * dt)
    seen = v + 0.002 * rng.normal(size=200)
    logs = LogSet([Log.from_arrays("late", dt * np.arange(200), u[:, None], seen[:, None], robot)])
    effects = [effect_by_id(robot, "motor_lag"), effect_by_id(robot, "sensor_delay", "early"),
               effect_by_id(robot, "input_delay")]  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = screen(robot, logs, effects, {"v": 0.002}, {})
    share = {promise.effect.id: promise.share for promise in found}
    assert set(share) == {"motor_lag", "sensor_delay", "input_delay"}
    assert share["input_delay"] > 0.8 > share["sensor_delay"]


def test_the_robot_as_it_is_is_simulated_without_any_secant():
    """As a comparison of two sets of logs asks for it."""
    table = {"mass": Parameter(2.0, "kg", free=True, lower=0.1), "fv": Parameter(4.0, "N s/m", free=True)}
    channels = Channels(inputs=("u",), outputs=("v",), units={"u": "N", "v": "m/s"})
    robot = Custom(dynamics=dynamics, state_names=("v",), own_channels=channels, table=table)
    log = Log.from_arrays("pulled", 0.02 * np.arange(60), np.ones((60, 1)), np.zeros((60, 1)), robot)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        first, found, _, _ = probed(
            robot, LogSet([log]), [], [], Seen(1.0, 1.2, lambda: None, lambda by_torque: ((), 0)), {}, None
        )
    assert found == []
    np.testing.assert_allclose(first[0, 0, :60, 0], 0.25 * (1.0 - np.exp(-0.04 * np.arange(60))), atol=1e-4)


def test_a_force_in_units_that_nobody_knows_moves_no_farther_than_all_that_drove():
    """What is typical of a force comes from a lever that is a unit's: a thousand times too much, where nothing is
    proportional."""
    table = {
        "mass": Parameter(2.0, "kg", free=True, lower=0.1),
        "fv": Parameter(4.0, "N s/m", free=True),
        "fc": Parameter(1.0, "N", free=True),
    }
    channels = Channels(inputs=("u",), outputs=("v",), units={"u": "N", "v": "mm/s"})
    robot = Custom(
        dynamics=lambda state, u, p, friction: {
            "v": 1000.0 * (u["u"] - p["fv"] * state["v"] / 1000.0 - friction["wheel"]) / p["mass"]
        },
        state_names=("v",),
        own_channels=channels,
        table=table,
        axes={"wheel": DriveAxis(speed="v", coulomb="fc", viscous="fv", torque=lambda s, u, p: u["u"], lever=0.001)},
        forces={"v": lambda s, p: p["mass"] / 1000.0},
        velocities=("v",),
    )
    u = np.repeat([3.0, -3.0, 2.0, -1.5], 50)
    log = Log.from_arrays("pulled", 0.02 * np.arange(200), u[:, None], np.zeros((200, 1)), robot)
    slope = effect_by_id(robot, "ground_slope", "along_a_line")
    seen = Seen(3.0, 4.0, lambda: None, lambda by_torque: ((), 0))
    with float64():
        first, (group,), _, _ = probed(robot, LogSet([log]), [(slope, slope)], [], seen, {}, None)
    moved = np.sqrt(np.mean((group.outputs[0] - first[0]) ** 2))
    assert 0.01 * np.std(first[0]) < moved < 5.0 * np.std(first[0])
    (strength,) = group.probe.strengths.values()
    assert 0.0 < strength < 3.0
