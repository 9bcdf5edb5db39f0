"""jaxid/simulation/reckoning.py: where a robot drove, from what its logs show of its motion."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, ParameterTable
from jaxid.explanation.where.conditions import motions
from jaxid.simulation.reckoning import measured_velocities
from jaxid.simulation.scaled import scales_of

CAR = Custom(
    dynamics=lambda s, u, p: {
        "v": (u["throttle"] - p["B"] * s["v"]) / p["m"],
        "r": (s["v"] * jnp.tan(u["steering"]) / p["L"] - s["r"]) / 0.1,
    },
    state_names=("v", "r"),
    own_channels=Channels(
        inputs=("throttle", "steering"),
        outputs=("v", "r"),
        units={"throttle": "N", "steering": "rad", "v": "m/s", "r": "rad/s"},
    ),
    table=ParameterTable({"m": Parameter(2.0, "kg", free=True), "B": Parameter(1.0), "L": Parameter(0.3)}),
    forces={"v": "m"},
    plane=("v", "", "r"),
    title="car",
)


@pytest.mark.parametrize("every", [1, 5])
def test_a_car_whose_yaw_rate_no_force_accelerates_drives_in_circles(every):
    """1 m/s at 0.5 rad/s: a circle of 2 m radius, and a heading that grows with time, also where a slower sensor tells it."""
    time = 0.02 * np.arange(801)
    outputs = np.column_stack([np.full(801, 1.0), np.full(801, 0.5)])
    outputs[np.arange(801) % every != 0, 1] = np.nan
    logs = LogSet([Log.from_arrays("circle", time, np.ones((801, 2)), outputs, CAR)])
    (motion,) = motions(CAR, logs)
    np.testing.assert_allclose(motion.heading, 0.5 * time, atol=1e-9)
    centre = np.array([0.0, 2.0])
    np.testing.assert_allclose(np.linalg.norm(motion.path - centre, axis=1), 2.0, atol=1e-3)
    assert scales_of(CAR, logs).length == pytest.approx(4.0, rel=1e-3)


def test_an_angle_in_another_unit_tells_the_speed():
    """One that swings by 2 rad/s at most, which is 115 in the unit of its sensor, and two that are told by their sum and
    difference."""
    time = 0.01 * np.arange(1001)
    pendulum = Custom(
        dynamics=lambda s, u, p: {"angle": s["speed"], "speed": u["u"] / p["J"]},
        state_names=("angle", "speed"),
        output=lambda s, u, p: {"deg": jnp.rad2deg(s["angle"])},
        own_channels=Channels(("u",), ("deg",), units={"u": "A", "deg": "deg"}),
        table={"J": Parameter(0.1)},
        velocities=("speed",),
        forces={"speed": "J"},
    )
    swing = np.rad2deg(np.sin(2.0 * time))
    log = Log.from_arrays("swing", time, np.ones((1001, 1)), {"deg": swing}, pendulum.channels)
    np.testing.assert_allclose(measured_velocities(pendulum, log)["speed"], 2.0 * np.cos(2.0 * time), atol=0.03)
    assert scales_of(pendulum, LogSet([log])).speed == pytest.approx(2.0, rel=0.02)
    pair = Custom(
        dynamics=lambda s, u, p: {"a": s["da"], "b": s["db"], "da": u["u"], "db": -u["u"]},
        state_names=("a", "b", "da", "db"),
        output=lambda s, u, p: {"sum": s["a"] + s["b"], "lead": s["a"] - s["b"]},
        own_channels=Channels(("u",), ("sum", "lead")),
        table={},
        velocities=("da", "db"),
        forces={"da": 1.0, "db": 1.0},
    )
    outputs = {"sum": 3.0 * time, "lead": -1.0 * time}
    log = Log.from_arrays("pair", time, np.ones((1001, 1)), outputs, pair.channels)
    found = measured_velocities(pair, log)
    np.testing.assert_allclose([found["da"], found["db"]], [np.full(1001, 1.0), np.full(1001, 2.0)], atol=1e-9)
