"""jaxid/simulation/reckoning.py: where a robot drove, from what its logs show of its motion."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, ParameterTable
from jaxid.explanation.conditions import motions
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
