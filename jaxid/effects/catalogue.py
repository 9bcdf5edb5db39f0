"""The catalogue: which effects a robot may be missing. To add one, write its class and name it here.

A robot gets the effects that its traits allow (`robots.traits`), whichever robot it is.
"""

from ..robots.effect import Effect
from ..robots.robot import Robot
from ..robots.traits import refusal
from .actuator import BatterySag, DeadZone, InputDelay, MotorGainMismatch, MotorHeating, MotorLag, VoltageSaturation
from .body import CoriolisCoupling, GroundSlope, LateralCentreOfMass, QuadraticDrag
from .drivetrain import (
    AsymmetricFriction,
    AsymmetricViscousFriction,
    CoggingTorque,
    StribeckFriction,
    SublinearViscousFriction,
)
from .ground import SurfaceChange, TractionLimit, WheelRadiusMismatch
from .sensor import SensorBias, SensorDelay, SensorLag, SensorScale

ALL: tuple[Effect, ...] = (
    DeadZone(),
    VoltageSaturation(),
    MotorLag(),
    InputDelay(),
    SensorBias(),
    SensorScale(),
    SensorLag(),
    SensorDelay(),
    StribeckFriction(),
    AsymmetricFriction(),
    AsymmetricViscousFriction(),
    SublinearViscousFriction(),
    CoggingTorque(),
    TractionLimit(),
    QuadraticDrag(),
    BatterySag(),
    MotorGainMismatch(),
    MotorHeating(),
    WheelRadiusMismatch(),
    SurfaceChange(),
    GroundSlope(),
    LateralCentreOfMass(),
    CoriolisCoupling(),
)
"""Every effect there is."""


def _applicable(robot: Robot) -> list[Effect]:
    """Every effect that the robot can have and that is not in it yet."""
    out = {effect.id for effect in robot.effects} | robot.expressed
    return [effect for effect in ALL if effect.id not in out and refusal(effect, robot) is None]


def catalogue(robot: Robot) -> list[Effect]:
    """Every effect that applies to `robot` and that it lacks."""
    return [effect for effect in _applicable(robot) if not effect.there_already(robot)]


def effect_by_id(robot: Robot, identifier: str) -> Effect:
    """The catalogue's effect with that identifier.

    Raises `KeyError`, which says why the robot cannot have it, or names those that apply and are not there yet.
    """
    found = {effect.id: effect for effect in _applicable(robot)}
    if identifier in found:
        return found[identifier]
    known = {effect.id: effect for effect in ALL}
    why = refusal(known[identifier], robot) if identifier in known else None
    if why is not None:
        raise KeyError(why)
    raise KeyError(f"no effect {identifier!r} applies to {robot.name}; there are {', '.join(found)}")
