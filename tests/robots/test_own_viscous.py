"""jaxid/robots/own_viscous.py: viscous friction in another unit than the axis' speed is what the dynamics make of it."""

import jax.numpy as jnp
import pytest

from jaxid import Channels, Custom, DriveAxis, Parameter, ParameterError, ParameterTable
from jaxid.effects import effect_by_id

CHANNELS = Channels(inputs=("u",), outputs=("v",), units={"v": "mm/s"})
TABLE = ParameterTable(
    {
        "m": Parameter(1.0, "kg", free=True),
        "fv": Parameter(2.0, "N s/m", free=True),
        "fc": Parameter(0.3, "N", free=True),
    }
)


def cart(dynamics, **declared):
    axes = {"wheel": DriveAxis(speed="v", coulomb="fc", viscous="fv", torque=lambda s, u, p: u["u"])}
    return Custom(dynamics=dynamics, state_names=("v",), own_channels=CHANNELS, table=TABLE, axes=axes, **declared)


def in_millimetres(unit):
    """Force in newtons, speed in mm/s: `unit` turns the latter into the former's."""
    return lambda s, u, p, friction: {"v": 1e3 * (u["u"] - unit * p["fv"] * s["v"] - friction["wheel"]) / p["m"]}


@pytest.mark.parametrize("unit", [1e-3, 1.0])
def test_half_of_the_viscous_friction_is_half_of_it_in_any_unit(unit):
    """A coefficient in N s/m of a speed in mm/s, and one in N s/mm: an effect that takes half of it leaves half of it."""
    robot = cart(in_millimetres(unit)) + effect_by_id(cart(in_millimetres(unit)), "sublinear_viscous_friction", "power")
    p = robot.with_values(**{"sublinear_viscous_friction.deficit": 1.0, "sublinear_viscous_friction.reference": 100.0})
    state, still = {"v": 200.0}, (0.0,)
    # At twice the reference speed the friction is half of what is proportional.
    slowed = float(p.rates(state, (0.0,), still, p.parameters.numbers)["v"])
    assert slowed == pytest.approx(-0.5 * 1e3 * unit * 2.0 * 200.0, rel=1e-3)


def test_forces_that_have_no_viscous_friction_or_one_that_drives():
    forces = {"v": "m"}
    with pytest.raises(ParameterError, match="no such force"):
        cart(lambda s, u, p: {"v": u["u"] / p["m"]}, forces=forces)
    with pytest.raises(ParameterError, match="-1 times"):
        cart(lambda s, u, p: {"v": (u["u"] + p["fv"] * s["v"]) / p["m"]}, forces=forces)
    cart(lambda s, u, p: {"v": (u["u"] - p["fv"] * s["v"]) / p["m"]}, forces=forces)


def test_a_coefficient_that_is_at_work_elsewhere_too_is_the_users():
    """Friction that heats what drives: no one number says how many times it is there."""
    heated = lambda s, u, p, friction: {  # noqa: E731
        "v": (u["u"] / (1.0 + p["fv"] * jnp.abs(s["v"])) - p["fv"] * s["v"] - friction["wheel"]) / p["m"]
    }
    assert cart(heated)._viscous_times == (1.0,)
