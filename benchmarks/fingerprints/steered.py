"""A car for the pictures of what goes wrong with steering: speed and yaw rate that follow throttle and steering angle."""

import jax.numpy as jnp

from jaxid import Channels, Custom, Parameter

PUSH, STEER = 4.0, 12.0
WHEELBASE = 0.26


def _rates(state, u, p, friction):
    wanted = state["v"] * jnp.tan(u["steering"]) / p["wheelbase"]
    return {
        "v": (PUSH * u["throttle"] - p["Fv"] * state["v"] - friction["wheels"]) / p["M"],
        "w": STEER * (wanted - state["w"]) / p["J"],
    }


CAR = Custom(
    dynamics=_rates,
    state_names=("v", "w"),
    own_channels=Channels(
        inputs=("throttle", "steering"),
        outputs=("v", "w"),
        units={"throttle": "V", "steering": "rad", "v": "m/s", "w": "rad/s"},
    ),
    dry_friction={"wheels": ("v", "Fc")},
    velocities=("v", "w"),
    words={"v": "forward speed", "w": "yaw rate"},
    table={
        "M": Parameter(3.0, "kg"),
        "J": Parameter(3.0, "kg m^2"),
        "Fv": Parameter(2.0, "N s/m"),
        "Fc": Parameter(0.8, "N"),
        "wheelbase": Parameter(WHEELBASE, "m"),
    },
    title="car",
)
