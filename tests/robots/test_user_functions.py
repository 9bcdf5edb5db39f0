"""Mistakes that users make in their own robots are said in a sentence that names them, when the robot is made."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Channels, Custom, Parameter, ParameterError

CHANNELS = Channels(inputs=("u",), outputs=("v",))


def cart(state, u, p):
    return {"v": (u["u"] - p["b"] * state["v"]) / p["m"]}


def rubbing_cart(state, u, p, friction):
    return {"v": (u["u"] - p["b"] * state["v"] - friction["rail"]) / p["m"]}


def branching(state, u, p):
    if state["v"] > 0:
        return cart(state, u, p)
    return {"v": u["u"] / p["m"]}


def made(dynamics, **changes):
    arguments = {
        "state_names": ("v",),
        "own_channels": CHANNELS,
        "table": {name: Parameter(1.0, free=True, lower=0.0) for name in ("m", "b", "Fc")},
    }
    return Custom(dynamics=dynamics, **(arguments | changes))


MISTAKES = {
    "python branch": (branching, {}, r"test_user_functions.py:\d+.*jnp.where"),
    "numpy function": (lambda s, u, p: {"v": np.sin(s["v"]) + u["u"]}, {}, "jax.numpy for numpy"),
    "math function": (lambda s, u, p: {"v": math.sin(s["v"]) + u["u"]}, {}, "jax.numpy for numpy and math"),
    "state without rate": (cart, {"state_names": ("v", "q")}, "nothing for 'q'"),
    "rate of no state": (lambda s, u, p: cart(s, u, p) | {"x": s["v"]}, {}, "value for 'x'.*lost"),
    "unknown parameter": (lambda s, u, p: {"v": u["u"] / p["mass"]}, {}, "parameter 'mass'.*there are.* m"),
    "unknown input": (lambda s, u, p: {"v": u["volts"]}, {}, "input 'volts'.*there are u"),
    "unknown state": (lambda s, u, p: {"v": s["w"]}, {}, "state 'w'.*there are v"),
    "attribute": (lambda s, u, p: {"v": u.u}, {}, "AttributeError.*mappings by name"),
    "tuple": (lambda s, u, p: (u["u"],), {}, "return a tuple"),
    "array": (lambda s, u, p: {"v": jnp.array([u["u"]])}, {}, r"shape \(1,\) for 'v'"),
    "output without channel": (cart, {"output": lambda s, u, p: {"w": s["v"]}}, "outputs.*nothing for 'v'"),
    "argument too many": (lambda s, u: {"v": s["v"]}, {}, "take 3 mappings"),
    "friction unused": (
        lambda s, u, p, friction: cart(s, u, p),
        {"dry_friction": {"rail": ("v", "Fc")}},
        "never use the friction of axis 'rail'",
    ),
    "friction misnamed": (rubbing_cart, {"dry_friction": {"slide": ("v", "Fc")}}, "axis 'rail'.*there are slide"),
    "plain numbers": (cart, {"table": {"m": 1.0, "b": 1.0}}, "'m' is a float.*Parameter"),
    "start of no state": (cart, {"start": {"q": 1.0}}, "start.*'q'.*states are v"),
}


WRONG_TYPES = ("plain numbers",)


@pytest.mark.parametrize(
    "mistake", [pytest.param(m, marks=[pytest.mark.wrong_types] * (m in WRONG_TYPES)) for m in MISTAKES]
)
def test_a_mistake_is_said_when_the_robot_is_made(mistake: str) -> None:
    dynamics, changes, message = MISTAKES[mistake]
    with pytest.raises(ParameterError, match=message):
        made(dynamics, **changes)


def test_what_is_right_passes() -> None:
    assert made(cart, state_names=["v"]).states == ("v",)
    assert made(cart, state_names="v").states == ("v",)
    assert made(rubbing_cart, dry_friction={"rail": ("v", "Fc")}).states == ("v",)
    assert made(cart, output=lambda s, u, p: {"v": s["v"], "unused": 1.0}).states == ("v",)


def test_changing_numbers_does_not_try_the_functions_again() -> None:
    tried = 0

    def counted(state, u, p):
        nonlocal tried
        tried += 1
        return cart(state, u, p)

    robot = made(counted)
    assert tried == 1
    robot.with_values(m=2.0).with_values(b=3.0)
    assert tried == 1
