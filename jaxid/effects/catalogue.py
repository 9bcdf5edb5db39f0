"""The catalogue: which effects a robot may be missing. To add one, write its class and its laws, and name it here.

A mechanism is a place in the signal path and what it depends on; its laws are the ways in which it is written, the usual one
first, and last, where it is one unknown function of one variable, a curve without a formula (`curve.py`). A robot gets the
mechanisms and laws that its traits allow (`robots.traits`), whichever robot it is.
"""

from collections.abc import Sequence

from ..logs.finding import did_you_mean
from ..parameters import ParameterError
from ..robots.effect import Effect
from ..robots.robot import Robot
from ..robots.traits import asked, refusal, traits_of
from .actuator import (
    battery_sag,
    dead_zone,
    freewheeling,
    input_delay,
    motor_cross_talk,
    motor_heating,
    motor_lag,
    motor_strength,
    saturation,
    steering_delay,
    steering_error,
    steering_lag,
)
from .body import coriolis, drag, forward_com, lateral_com, payload, slope
from .drivetrain import (
    asymmetric_friction,
    asymmetric_viscous_friction,
    backlash,
    cogging_torque,
    coulomb_friction,
    load_dependent_friction,
    stribeck_friction,
    viscous_shape,
)
from .ground import (
    effective_track,
    sideways_friction,
    surface_change,
    traction_limit,
    turning_friction,
    wheel_radius_mismatch,
)
from .sensor import bias, cross_talk, delay, lag, scale

MECHANISMS: tuple[tuple[Effect, ...], ...] = (
    dead_zone.LAWS,
    saturation.LAWS,
    motor_lag.LAWS,
    input_delay.LAWS,
    freewheeling.LAWS,
    bias.LAWS,
    scale.LAWS,
    cross_talk.LAWS,
    lag.LAWS,
    delay.LAWS,
    coulomb_friction.LAWS,
    stribeck_friction.LAWS,
    asymmetric_friction.LAWS,
    asymmetric_viscous_friction.LAWS,
    viscous_shape.LAWS,
    load_dependent_friction.LAWS,
    cogging_torque.LAWS,
    traction_limit.LAWS,
    turning_friction.LAWS,
    sideways_friction.LAWS,
    drag.LAWS,
    battery_sag.LAWS,
    motor_strength.LAWS,
    motor_cross_talk.LAWS,
    steering_delay.LAWS,
    steering_error.LAWS,
    steering_lag.LAWS,
    motor_heating.LAWS,
    wheel_radius_mismatch.LAWS,
    effective_track.LAWS,
    surface_change.LAWS,
    slope.LAWS,
    lateral_com.LAWS,
    forward_com.LAWS,
    coriolis.LAWS,
    backlash.LAWS,
    payload.LAWS,
)
"""The laws of every mechanism, the usual one first."""
ALL: tuple[Effect, ...] = tuple(laws[0] for laws in MECHANISMS)
"""Every mechanism there is, by its usual law."""


def _applicable(robot: Robot, *only: str) -> list[list[Effect]]:
    """The laws that the robot can have of every mechanism (of the `only` ones asked for) that is not in it yet."""
    out, there = {effect.id for effect in robot.effects} | robot.expressed, traits_of(robot)
    asked_for = (laws for laws in MECHANISMS if laws[0].id not in out and (not only or laws[0].id in only))
    possible = [[law for law in laws if refusal(law, robot, there) is None] for laws in asked_for]
    return [laws for laws in possible if laws]


def check_mechanisms(robot: Robot, others: Sequence[Effect] = ()) -> None:
    """Raise `ParameterError` where the robot has parameters for a mechanism (`mechanisms=`) that is neither in the catalogue
    nor among `others`, the user's own: nothing would ever free them."""
    known = [effect.id for laws in (*MECHANISMS, tuple(others)) for effect in laws if "mechanism" in asked(effect)]
    for name in robot.mechanisms:
        if name not in known:
            raise ParameterError(
                f"{robot.name}: mechanisms= names {name!r}{did_you_mean(name, known)}, for which no effect asks; there are "
                f"{', '.join(dict.fromkeys(known))}"
            )


def catalogue(robot: Robot) -> list[Effect]:
    """Every mechanism that applies to `robot` and that it lacks, by its usual law (of those that the robot can have).

    >>> import jaxid
    >>> friction = next(own for own in jaxid.catalogue(jaxid.Pioneer()) if own.id == "stribeck_friction")
    >>> robot = jaxid.Pioneer() + friction
    >>> "stribeck_friction.amplitude" in robot.parameters
    True
    """
    return [laws[0] for laws in _applicable(robot) if not laws[0].there_already(robot)]


def laws_of(robot: Robot, identifier: str) -> list[Effect]:
    """All laws of a mechanism that `robot` can have, the usual one first; none where it cannot have the mechanism."""
    return next(iter(_applicable(robot, identifier)), [])


def effect_by_id(robot: Robot, identifier: str, law: str = "") -> Effect:
    """The catalogue's effect with that identifier, by its usual `law` or the one asked for.

    Raises `KeyError`, which says why the robot cannot have it, or names those that apply and are not there yet.
    """
    there = laws_of(robot, identifier)
    named = {effect.law: effect for effect in there}
    if there and (not law or law in named):
        return named[law] if law else there[0]
    known = {effect.law: effect for laws in MECHANISMS for effect in laws if effect.id == identifier}
    meant = known.get(law) if law else next(iter(known.values()), None)
    why = refusal(meant, robot) if meant is not None else None
    if why is not None:
        raise KeyError(why)
    if there:
        raise KeyError(f"{identifier!r} has no law {law!r}; there are {', '.join(named)}")
    raise KeyError(
        f"no effect {identifier!r} applies to {robot.name}; there are {', '.join(laws[0].id for laws in _applicable(robot))}"
    )
