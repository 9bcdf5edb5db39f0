"""Short forms for the parameters of effects: zero means absent, `typical` is the order of magnitude to expect."""

import numpy as np

from ..parameters import Parameter
from ..robots.effect import Effect
from ..robots.robot import Robot
from ..robots.scales import time_constant

WAYS = ("forward", "backward")
"""What laws of either way call them."""


PER_AXIS = "per_axis"
"""Name of laws by which every drive axis has numbers of its own."""


def axis_names(robot: Robot) -> tuple[str, ...]:
    """The robot's drive axes as the names of parameters count them, from 1."""
    return tuple(str(k + 1) for k in range(len(robot.drive_axes)))


def positive(effect: Effect, name: str, unit: str, typical: float, value: float = 0.0) -> dict[str, Parameter]:
    """A parameter of an effect that cannot be negative."""
    return {effect.key(name): Parameter(value, unit, free=True, lower=0.0, typical=typical, source="catalogue")}


def signed(effect: Effect, name: str, unit: str, typical: float, value: float = 0.0) -> dict[str, Parameter]:
    """A parameter of an effect that may have either sign."""
    return {effect.key(name): Parameter(value, unit, free=True, typical=typical, source="catalogue")}


def share(effect: Effect, name: str) -> dict[str, Parameter]:
    """By what share something that cannot be negative differs: no more than all of it can be gone."""
    return {effect.key(name): Parameter(0.0, "", free=True, lower=-1.0, typical=1.0, source="catalogue")}


def shape(effect: Effect, name: str, unit: str, value: float, *, free: bool = True) -> dict[str, Parameter]:
    """A parameter that says at which speed, angle or place an effect acts; it means nothing while the effect is absent."""
    lower = 0.0 if value > 0 else -float("inf")
    return {
        effect.key(name): Parameter(value, unit, free=free, lower=lower, typical=abs(value) or 1.0, source="catalogue")
    }


def exchanged(robot: Robot, name: str) -> dict[str, float]:
    """The robot's own time constant for the one called `name`: of two lags one after the other the motion shows both, and
    hardly which is whose, so that a search may end with either."""
    own = float(time_constant(robot))
    return {name: own} if np.isfinite(own) and own > 0 else {}


def still(effect: Effect, unit: str, value: float) -> dict[str, Parameter]:
    """The fixed speed below which something hardly moves, so that a sign passes smoothly through zero.

    Stages take such sizes from here: what is compiled for a robot is compiled for all sizes, so that `robot.scales` would be
    those of whoever came first.
    """
    return shape(effect, "still", unit, value, free=False)


def shortest(effect: Effect, value: float) -> dict[str, Parameter]:
    """The fixed time below which a time constant counts as this one, since shorter ones take finer steps; see `still`."""
    return shape(effect, "shortest", "s", value, free=False)


def per_speed(force: str, speed: str, power: int = 1) -> str:
    """Unit of a force [`force`] over a power of a speed [`speed`], such as "N s/m" of "N" and "m/s", "mN m/rpm" of "rpm"."""
    length, _, time = speed.partition("/")
    exponent = f"^{power}" if power > 1 else ""
    return f"{force} {time}{exponent}/{length}{exponent}" if time else f"{force}/{length}{exponent}"
