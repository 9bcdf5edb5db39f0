"""jaxid/explanation/smooth_friction.py: friction that a user has written as a steep function of a speed."""

import jax.numpy as jnp
import pytest

from jaxid import Axis, Channels, Custom, Parameter
from jaxid.effects import effect_by_id
from jaxid.explanation.smooth_friction import smoothed_friction

TABLE = {name: Parameter(value, free=True, lower=0.0) for name, value in {"M": 2.0, "B": 3.0, "C": 1.5}.items()}


def cart(law, **more):
    def dynamics(state, inputs, p, *friction):
        rubs = law(state["v"], p) + sum(own["wheels"] for own in friction)
        return {"v": (inputs["u"] - p["B"] * state["v"] - rubs) / p["M"]}

    def sticking(state, inputs, p, friction):
        return dynamics(state, inputs, p, friction)

    own = {"state_names": ("v",), "own_channels": Channels(("u",), ("v",)), "table": TABLE}
    return Custom(dynamics=sticking if more else dynamics, **own, **more)


LAWS = {
    "tanh": (lambda v, p: p["C"] * jnp.tanh(v / 0.01), True),
    "arc tangent": (lambda v, p: p["C"] * jnp.arctan(v / 0.005), True),
    "by the root": (lambda v, p: p["C"] * v / jnp.sqrt(v**2 + 1e-4), True),
    "none": (lambda v, p: 0.0, False),
    "drag": (lambda v, p: p["C"] * v * jnp.abs(v), False),
    "less than in proportion": (lambda v, p: p["C"] * v / jnp.sqrt(1.0 + v**2), False),
}


@pytest.mark.parametrize("law", LAWS)
def test_friction_that_is_steep_at_standstill_is_said_and_nothing_else(law):
    written, steep = LAWS[law]
    said = smoothed_friction(cart(written))
    assert ("steeply with v" in said and "dry_friction=" in said) if steep else not said


def test_friction_that_is_declared_sticks_and_is_not_meant():
    assert not smoothed_friction(cart(LAWS["none"][0], dry_friction={"wheels": ("v", "C")}))
    assert not smoothed_friction(Axis())


def test_an_effect_that_bends_so_is_none_of_the_users_equations():
    """Sideways friction of the catalogue is smooth where a robot hardly slides."""

    def dynamics(state, inputs, p):
        return {
            "v": (inputs["u"] - p["B"] * state["v"]) / p["M"],
            "vy": -p["B"] * state["vy"] / p["M"],
            "w": -state["w"],
        }

    channels = Channels(("u",), ("v", "vy", "w"))
    forces = {"v": "M", "vy": "M", "w": 1.0}
    robot = Custom(
        dynamics=dynamics, state_names=channels.outputs, own_channels=channels, table=TABLE, forces=forces, turning="w"
    )
    assert not smoothed_friction(robot)
    slipping = robot + effect_by_id(robot, "sideways_friction")
    assert not smoothed_friction(slipping.with_values(**{"sideways_friction.coulomb_vy": 5.0}))
    # The state has no unit, and so has what its friction is in proportion to.
    assert slipping.parameters["sideways_friction.viscous_vy"].unit == "N"
