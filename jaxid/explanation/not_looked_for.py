"""Effects that could not be looked for, since a user's robot does not declare what they take.

What has a name may stand in for one of them: a drag that the dynamics keep to themselves leaves what a rise of friction
towards standstill leaves, too.
"""

import re
from collections.abc import Sequence

from ..effects.catalogue import ALL, laws_of
from ..effects.drivetrain import CoulombFriction
from ..robots.declared import Declared
from ..robots.effect import Effect, in_words
from ..robots.robot import Robot
from ..robots.traits import TRAITS, asked, refusal, traits_of

_BY_NATURE = ("several_drives", "steered")
"""Traits that a robot has not for want of a word."""
_OF_A_LINE = ("payload_change",)
"""Mechanisms of a parameter of the robot's own that one that goes along a line can have; the others take one that turns."""
_SIDEWAYS = ("coriolis_coupling",)
"""Those that take one that moves sideways as well."""


def _wanted(trait: str, robot: Robot) -> list[str]:
    """The arguments that would give the trait and were not passed; where all were, what they have to hold."""
    arguments = re.findall(r"`\w+=`", TRAITS[trait])
    left = [word for word in arguments if not getattr(robot, word.strip("`="), None)]
    whole = re.search(r"\((.*`\w+=`.*)\)", TRAITS[trait])
    return left if left or whole is None else [whole.group(1)]


def _by_nature(effect: Effect, lacking: Sequence[str], robot: Robot) -> bool:
    """Whether no word of the user's would let the robot have the effect."""
    if set(lacking) & set(_BY_NATURE):
        return True
    if "mechanism" not in lacking or effect.id in _OF_A_LINE:
        return False
    least = 3 if effect.id in _SIDEWAYS else 2
    return not robot.turns or len(robot.velocities) < least


def _in_no_loop(robot: Robot) -> str:
    """A sentence that names the effects that the plant of a controlled robot may lack and its loop cannot have."""
    plant = robot.alone
    out = {effect.id for effect in plant.effects} | plant.expressed
    names = [e.id for e in ALL if e.id not in out and refusal(e, plant) is None and refusal(e, robot) is not None]
    if not names:
        return ""
    return (
        f"Not looked for in a closed loop: {', '.join(map(in_words, names))}. What is missing may be one of these, or have the "
        "name of another that can do the same; an explanation of the plant at its logged commands looks for them."
    )


def not_looked_for(robot: Robot) -> str:
    """A sentence that names those effects with the arguments that would let them act; empty where there are none."""
    if robot.controlled:
        return _in_no_loop(robot)
    if not robot.declared:
        return ""
    out = {effect.id for effect in robot.effects} | robot.expressed
    found: dict[str, list[str]] = {}
    for effect in ALL:
        lacking = [trait for trait in asked(effect) if trait not in traits_of(robot)]
        refused = effect.id not in out and lacking and refusal(effect, robot) is not None
        if refused and not _by_nature(effect, lacking, robot):
            arguments = [word for trait in lacking for word in _wanted(trait, robot)]
            other_laws = laws_of(robot, effect.id)
            name = effect.title if other_laws else in_words(effect.id)
            found.setdefault(", ".join(dict.fromkeys(arguments)), []).append(name)
    if isinstance(robot, Declared) and not robot.dry and refusal(CoulombFriction(), robot) is not None:
        # Others change it: those of an axis without may then be it, under their names.
        found.setdefault("`axes=` with `coulomb`, or `dry_friction=`", []).append("dry friction")
    if not found:
        return ""
    listed = "; ".join(f"{', '.join(names)} ({arguments})" for arguments, names in found.items())
    return (
        f"Not looked for, since the robot {robot.name!r} does not declare what they act on: {listed}. What is missing may be "
        "one of these, or have the name of another that can do the same."
    )
