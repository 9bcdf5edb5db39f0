"""The catalogue: which effects a robot may be missing. To add one, write its class and name it here."""

from ..robots.axis import Axis
from ..robots.effect import Effect
from ..robots.omni import Omni
from ..robots.pioneer import Pioneer
from ..robots.robot import Robot
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


def _signal_effects(robot: Robot) -> list[Effect]:
    """What can happen to commands and measurements of any robot."""
    bare = robot.structure
    return [
        DeadZone(),
        VoltageSaturation(),
        MotorLag(),
        InputDelay(),
        SensorBias(bare),
        SensorScale(bare),
        SensorLag(bare),
        SensorDelay(bare),
    ]


def _drive_effects(robot: Robot) -> list[Effect]:
    """What can happen to friction and forces of a robot whose drive axes are known."""
    bare = robot.structure
    return [
        StribeckFriction(bare),
        AsymmetricFriction(bare),
        AsymmetricViscousFriction(bare),
        SublinearViscousFriction(bare),
        CoggingTorque(bare),
        TractionLimit(bare),
        QuadraticDrag(bare),
    ]


def _applicable(robot: Robot) -> list[Effect]:
    """Every effect that a robot of this kind can have and that is not in this one yet."""
    found = _signal_effects(robot)
    if robot.drive_axes:
        found += _drive_effects(robot)
    if isinstance(robot, Pioneer | Omni):
        bare = robot.structure
        found += [
            BatterySag(12.0 if isinstance(robot, Pioneer) else 24.0),
            MotorGainMismatch(),
            MotorHeating(robot.channels.inputs),
            WheelRadiusMismatch(),
            SurfaceChange(bare),
            GroundSlope(bare),
        ]
    if isinstance(robot, Pioneer):
        found.append(LateralCentreOfMass(("xm",)))
    if isinstance(robot, Omni):
        found += [LateralCentreOfMass(("yc", "xc")), CoriolisCoupling()]
    if isinstance(robot, Axis):
        found = [effect for effect in found if effect.id != "asymmetric_friction"]  # the offset is the same model
    present = {effect.id for effect in robot.effects}
    return [effect for effect in found if effect.id not in present]


def catalogue(robot: Robot) -> list[Effect]:
    """Every effect that applies to `robot` and that it lacks."""
    # The turning frame's own terms are lacking only where they have been left out.
    whole = isinstance(robot, Omni) and robot.parameters["coriolis"].value != 0.0
    return [effect for effect in _applicable(robot) if not (whole and isinstance(effect, CoriolisCoupling))]


def effect_by_id(robot: Robot, identifier: str) -> Effect:
    """The catalogue's effect with that identifier. Raises `KeyError` naming those that apply and are not there yet."""
    found = {effect.id: effect for effect in _applicable(robot)}
    if identifier in found:
        return found[identifier]
    known = ", ".join(found)
    raise KeyError(f"no effect {identifier!r} applies to {robot.name}; there are {known}")
