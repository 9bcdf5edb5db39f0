"""What a robot can say about itself, and what an effect asks for.

An effect that needs a trait which the robot lacks is refused with a sentence; the catalogue leaves it out. A robot has a
trait by saying so: built-in robots by class attributes and methods, a `Custom` by its arguments.
"""

from typing import TYPE_CHECKING

from .effect import Effect
from .signal_path import POSE_STATES, STAGES, overrides

if TYPE_CHECKING:
    from .robot import Robot

TRAITS = {
    "supply": "the currents of its motors (`motor_currents=`)",
    "torque": "the torques of its drive axes (`axes=` with `torque`)",
    "dry": "axes that rub (`axes=` or `dry_friction=`)",
    "viscous": "the viscous friction of its axes (`axes=` with `viscous`)",
    "force": "what a generalised force accelerates (`forces=`)",
    "drive_axes": "which axes its motors drive (`axes=`)",
    "wheel_angles": "the angles of its driving wheels (`axes=` with `angle`)",
    "pose": "how it moves in the plane (`plane=`)",
    "translation": "which of its velocities is no turning (`velocities=`)",
    "weight": "how weight pulls at it in the plane (`plane=`, `mass=` and `forces=`)",
    "winding": "the resistance of its motors' windings (`winding=`)",
    "supply_voltage": "its supply's voltage (`supply_voltage=`)",
    "several_drives": "more than one drive input",
    "steered": "an input that does not drive, in another unit than the first",
    "mechanism": "a parameter of its own for that (`mechanisms=`)",
}
"""Traits by name, each with what the robot has to say to have it."""


IN_NO_LOOP = (
    "acts on whole recorded signals, which a closed loop makes as it goes; give the controller such a delay or sensor as "
    "states of its own"
)
"""Why a controlled robot has no effect on commands and sensors."""


def on_whole_signals(effect: Effect) -> bool:
    """Whether an effect acts on whole commanded or measured signals."""
    return overrides(type(effect), "command") or overrides(type(effect), "measure")


def traits_of(robot: "Robot") -> frozenset[str]:
    """The traits that a robot has."""
    found = set(robot.stages)
    found |= {"drive_axes"} if robot.drive_axes else set()
    found |= {"wheel_angles"} if robot.angles else set()
    found |= {"pose"} if robot.in_plane or set(POSE_STATES) <= set(robot.own_states) else set()
    found |= {"translation"} if robot.translates else set()
    found |= {"weight"} if robot.weighs else set()
    found |= {"winding"} if robot.winding else set()
    found |= {"supply_voltage"} if robot.supply_voltage is not None else set()
    found |= {"several_drives"} if len(robot.drive_inputs) > 1 else set()
    found |= {"steered"} if len(robot.drive_inputs) < len(robot.channels.inputs) else set()
    return frozenset(found)


def asked(effect: Effect) -> tuple[str, ...]:
    """The traits that an effect needs: those it names, and those of the stages at which it acts."""
    acts = (stage for stage in STAGES if overrides(type(effect), stage))
    return tuple(dict.fromkeys((*acts, *effect.needs)))


def refusal(effect: Effect, robot: "Robot", there: frozenset[str] | None = None) -> str | None:
    """Why `robot` cannot have `effect`, in a sentence; None if it can. `there` are the robot's traits, where they are known:
    who asks for a hundred laws finds them once."""
    if robot.controlled and on_whole_signals(effect):
        return f"the effect {effect.id!r} {IN_NO_LOOP}"
    there = traits_of(robot) if there is None else there
    if effect.id in robot.mechanisms:
        there |= {"mechanism"}
    lacking = [trait for trait in asked(effect) if trait not in there]
    if lacking:
        said = " and ".join(TRAITS.get(trait, trait) for trait in lacking)
        return f"the robot {robot.name!r} cannot have the effect {effect.id!r}: it does not say {said}"
    return effect.refusal(robot.alone)


def axes_in_words(robot: "Robot") -> tuple[str, ...]:
    """What sentences call the drive axes: as the robot does, two that it does not tell apart by the sides of their wheels."""
    if robot.axis_words:
        return robot.axis_words
    if len(robot.drive_axes) == 2:
        return tuple(f"the {side}" for side in robot.wheel_sides)
    return tuple(f"wheel {k + 1}" for k in range(len(robot.drive_axes)))
