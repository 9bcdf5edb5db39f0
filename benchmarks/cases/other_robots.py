"""Families of the wide draw that the first one does not have: robots and hidden forces on which nothing was ever tuned.

A user's model has a law of its own (the cart's drag grows with the speed's power 1.5); hidden are a drag of a power between
one and two and a dry friction that changes with the position.
"""

from collections.abc import Callable
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

import jaxid
from benchmarks.cases.family import Family, Numbers, Units, between, free, signal
from benchmarks.cases.own_robots import TWO_FAMILY, VELOCITY_FAMILY, lags, mechanism_states, two_masses, velocity_rates
from jaxid import Channels, Custom, Parameter
from reference import other_mechanisms as om


def _hidden(drag: tuple[float, float], speed: float, friction: str, slope: float, period: float) -> dict[str, Callable]:
    found = {
        "drag of another power": lambda rng, p: {"drag": between(rng, *drag), "power": rng.uniform(1.3, 1.8)},
        "slope": lambda rng, p: {"slope": slope * rng.uniform(0.3, 1.0)},
    }
    if friction:
        found["stribeck"] = lambda rng, p: {"stribeck": p[friction] * rng.uniform(0.5, 1.5), "stribeck_speed": speed}
        found["friction by position"] = lambda rng, p: {
            "ripple": rng.uniform(0.2, 0.8),
            "period": period * between(rng, 0.3, 3.0),
        }
    return found


# -- belt drive ------------------------------------------------------------------------------------------------------
_BELT_CHANNELS = Channels(inputs=("u",), outputs=("q1", "w2"), units={"q1": "rad", "w2": "rad/s", "u": "V"})
BELT_FAMILY = replace(
    TWO_FAMILY,
    name="belt drive",
    share=0.2,
    draw=lambda rng: {
        "J1": between(rng, 0.5, 1.5),
        "J2": between(rng, 0.3, 2.0),
        "s": between(rng, 40.0, 400.0),
        "d": between(rng, 0.2, 2.0),
        "b": between(rng, 0.5, 3.0),
        "Tc": between(rng, 0.2, 1.0),
        "k": 1.0,
    },  # fmt: skip
    excite=lambda rng, n, kind, p: signal(rng, n, kind, 5.0, p["Tc"])[:, None],
    states=mechanism_states(om.BELT),
    see=lambda x, p: x[:, [0, 3]],
    move=lambda rng, p: np.array([0.0, rng.uniform(-0.02, 0.02), *rng.uniform(-1.0, 1.0, 2)]),
    model=two_masses("belt drive", ("q1", "q2", "w1", "w2"), ("J1", "J2", "Tc"), _BELT_CHANNELS, rotary=True),
    output_units=lambda u: (1.0, 1 / u.time),
    effects=_hidden((0.1, 1.0), 0.2, "Tc", 0.5, 0.5),
    has_length=False,
    angle_outputs=(0,),
)


# -- unicycle --------------------------------------------------------------------------------------------------------
def _unicycle_rates(state, inputs, p):
    ahead = {"x": state["v"] * jnp.cos(state["h"]), "y": state["v"] * jnp.sin(state["h"]), "h": state["w"]}
    return ahead | velocity_rates(state, inputs, p)


_UNICYCLE_CHANNELS = Channels(inputs=("vc", "wc"), outputs=("x", "y", "h"), units={"x": "m", "y": "m", "h": "rad"})


def _unicycle_model(p: Numbers, u: Units) -> jaxid.Robot:
    return Custom(
        dynamics=_unicycle_rates, state_names=("x", "y", "h", "v", "w"), own_channels=_UNICYCLE_CHANNELS, table=lags(p, u),
        title="unicycle",
    )  # fmt: skip


UNICYCLE_FAMILY = replace(
    VELOCITY_FAMILY,
    name="unicycle",
    share=0.15,
    states=mechanism_states(om.UNICYCLE),
    see=lambda x, p: x[:, :3],
    move=lambda rng, p: np.array([0.0, 0.0, rng.uniform(-1, 1), rng.uniform(0.2, 0.6), rng.uniform(-0.5, 0.5)]),
    rest=lambda p: np.zeros(5),
    model=_unicycle_model,
    output_units=lambda u: (u.length, u.length, 1.0),
    effects=_hidden((0.1, 1.0), 0.1, "", 0.2, 1.0),
    angle_outputs=(2,),
)


# -- cart on a slope -------------------------------------------------------------------------------------------------
def _cart_rates(state, inputs, p, friction):
    v = state["v"]
    force = p["k"] * inputs["u"] - p["b"] * v - p["c"] * v * jnp.abs(v) ** 0.5 - friction["rail"]
    return {"q": v, "v": force / p["m"] - p["g"] * jnp.sin(p["a"])}


_CART_CHANNELS = Channels(inputs=("u",), outputs=("q",), units={"q": "m", "u": "V"})


def _cart_model(p: Numbers, u: Units) -> jaxid.Robot:
    table = {
        "m": free(p["m"] * u.mass), "b": free(p["b"] * u.mass / u.time), "c": free(p["c"] * u.force / u.speed**1.5),
        "Fc": free(p["Fc"] * u.force), "a": free(p["a"], positive=False),
        "k": Parameter(p["k"] * u.force / u.input), "g": Parameter(p["g"] * u.length / u.time**2),
    }  # fmt: skip
    return Custom(
        dynamics=_cart_rates, state_names=("q", "v"), own_channels=_CART_CHANNELS, table=table,
        dry_friction=(("rail", "v", "Fc"),), title="cart on a slope",
    )  # fmt: skip


CART_FAMILY = Family(
    name="cart on a slope",
    share=0.2,
    draw=lambda rng: {
        "m": between(rng, 0.5, 2.0),
        "k": 1.0,
        "b": between(rng, 0.3, 1.5),
        "c": between(rng, 0.3, 1.5),
        "Fc": between(rng, 0.2, 1.0),
        "a": rng.uniform(-0.08, 0.08),
        "g": 9.81,
    },  # fmt: skip
    excite=lambda rng, n, kind, p: signal(rng, n, kind, 4.0, p["Fc"] + abs(p["m"] * p["g"] * p["a"]))[:, None],
    states=mechanism_states(om.CART),
    see=lambda x, p: x[:, [0]],
    move=lambda rng, p: np.array([rng.uniform(-1, 1), rng.uniform(0.3, 1.0)]),
    rest=lambda p: np.zeros(2),
    model=_cart_model,
    output_units=lambda u: (u.length,),
    input_units=lambda u: (u.input,),
    forces=lambda p: (1.5,),
    effects=_hidden((0.2, 2.0), 0.1, "Fc", 0.5, 0.3),
)
