"""jaxid/effects/catalogue.py: parameters that a robot declares for a mechanism which does not exist are no silence."""

from dataclasses import dataclass
from typing import ClassVar

import pytest

from jaxid import Channels, Custom, Omni, Parameter, ParameterError, ParameterTable, Pioneer
from jaxid.effects.catalogue import check_mechanisms
from jaxid.effects.own_parameter import OwnParameter


def cart(**mechanisms):
    return Custom(
        dynamics=lambda s, u, p: {"v": (u["u"] - p["fv"] * s["v"]) / p["m"]},
        state_names=("v",),
        own_channels=Channels(inputs=("u",), outputs=("v",)),
        table=ParameterTable({"m": Parameter(1.0, "kg", free=True), "fv": Parameter(1.0, "N s/m", free=True)}),
        mechanisms=mechanisms,
    )


@dataclass(frozen=True)
class WornTyre(OwnParameter):
    id: ClassVar[str] = "worn_tyre"


def test_a_mechanism_that_nothing_frees_is_named_with_what_is_meant():
    with pytest.raises(ParameterError, match=r"'payload' \(close: 'payload_change'\)"):
        check_mechanisms(cart(payload=("m",)))
    with pytest.raises(ParameterError, match="worn_tyre"):
        check_mechanisms(cart(worn_tyre=("fv",)))


def test_mechanisms_of_shipped_robots_and_of_the_users_own_effects_are_known():
    for robot in (Pioneer(), Omni(), cart(payload_change=("m",))):
        check_mechanisms(robot)
    check_mechanisms(cart(worn_tyre=("fv",)), [WornTyre()])
