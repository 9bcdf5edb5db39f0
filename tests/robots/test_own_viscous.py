"""jaxid/robots/own_viscous.py: viscous friction in another unit than the dynamics have it is refused, with the factor."""

import jax.numpy as jnp
import pytest

from jaxid import Channels, Custom, DriveAxis, Parameter, ParameterError, ParameterTable

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


def test_a_coefficient_in_newtons_per_metre_and_second_of_a_speed_in_millimetres():
    with pytest.raises(ParameterError, match=r"'wheel'.*'fv'.* 0\.001 times that force.*leave `viscous` out"):
        cart(in_millimetres(1e-3))
    assert cart(in_millimetres(1.0)).parameters["fv"].value == 2.0


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
    cart(heated)
