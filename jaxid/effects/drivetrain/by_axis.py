"""What laws of friction that differs by direction or from axis to axis share, dry or viscous."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.effect import Effect, Levels, Numbers, Scalar, Scalars, State
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import WAYS, axis_names, signed


def differs_by_way(curve: Curve, robot: Robot) -> bool:
    """Whether a curve for either way (`WAYS`) of each of the robot's axes differs between the ways more than it bends alike
    both ways, which is a law of friction that no direction changes. What is constant or proportional to the speed both ways
    is the robot's own Coulomb and viscous friction. It does not where one of the ways was never gone (all heights held)."""
    parts, table = curve.parts(robot) if curve.apart else ("",), robot.parameters
    for way in WAYS:
        if not any(table[curve.height(k, curve.of(part, way))].free for part in parts for k in curve.varying):
            return False
    p, share, one_way, both = robot.parameters.numbers, np.linspace(0.0, 1.0, 51), 0.0, 0.0
    own = np.stack([np.ones_like(share), share], axis=1)
    for part in parts:
        forward, backward = (
            np.asarray(curve.at(share * p[curve.key("reach")], p, curve.of(part, way))) for way in WAYS
        )
        alike = 0.5 * (forward + backward)
        alike = alike - own @ np.linalg.lstsq(own, alike, rcond=None)[0]
        one_way, both = one_way + float(np.sum((0.5 * (forward - backward)) ** 2)), both + float(np.sum(alike**2))
    return one_way >= both


def apart_already(robot: Robot, friction: Callable[[State, Numbers], list[float]]) -> bool:
    """Whether the robot's own free parameters can change the `friction` of each drive axis on its own."""
    numbers, zero = robot.parameters.numbers, dict.fromkeys(robot.states, 0.0) | robot.initial_state()
    levels = [friction(zero, numbers)]
    for name in robot.parameters.free_names:
        more = numbers[name] + (abs(numbers[name]) or robot.parameters[name].typical or 1.0)
        levels.append(friction(zero, {**numbers, name: more}))
    changes = np.array(levels[1:]).reshape(-1, len(levels[0])) - np.array(levels[0])
    sizes = np.linalg.norm(changes, axis=1)
    changes = changes[sizes > 0] / sizes[sizes > 0, None]
    return len(changes) > 0 and int(np.linalg.matrix_rank(changes, tol=1e-6)) == len(levels[0])


def differences(effect: Effect, robot: Robot) -> dict[str, Parameter]:
    """One for each drive axis but the last, whose own is that with which all add up to zero."""
    found: dict[str, Parameter] = {}
    for name in axis_names(robot)[:-1]:
        found |= signed(effect, f"difference_{name}", "", 0.1)
    return found


def shares(effect: Effect, robot: Robot, p: Numbers) -> Scalars:
    """What to multiply the friction of each drive axis with, by `differences`; no friction drives."""
    own = [p[effect.key(f"difference_{name}")] for name in axis_names(robot)[:-1]]
    return tuple(jnp.maximum(1.0 + share, 0.0) for share in (*own, -sum(own)))


Value = TypeVar("Value")


def on_drive_axes(
    robot: Robot, values: Sequence[Value], parts: Sequence[Scalar], changed: Callable[[Value, Scalar], Value]
) -> tuple[Value, ...]:
    """`values`, one an axis, with `changed(value, part)` at the drive axes, which have one part each."""
    found = list(values)
    for axis, part in zip(robot.drive_axes, parts, strict=True):
        found[axis] = changed(found[axis], part)
    return tuple(found)


def at_rims(robot: Robot, p: Numbers, forces: Sequence[Scalar]) -> Scalars:
    """One force at the rim of each drive axis as its axis feels it, in units of the first one's lever."""
    levers = robot.rim_levers(p)
    first = levers[robot.drive_axes[0]]
    pairs = zip(robot.drive_axes, forces, strict=True)
    return tuple(f if levers[axis] is first else f * (levers[axis] / first) for axis, f in pairs)


def rubbing_more(
    robot: Robot, p: Numbers, levels: Levels, backward: Sequence[Scalar], forward: Sequence[Scalar]
) -> Levels:
    """Dry friction with so much more at the rim of each drive axis, `backward` and `forward`; no friction drives."""
    more, found = zip(at_rims(robot, p, backward), at_rims(robot, p, forward), strict=True), list(levels)
    for axis, (back, ahead) in zip(robot.drive_axes, more, strict=True):
        found[axis] = (jnp.maximum(levels[axis][0] + back, 0.0), jnp.maximum(levels[axis][1] + ahead, 0.0))
    return tuple(found)


def has_one_axis(effect: Effect, robot: Robot) -> str | None:
    """The refusal of a law of each axis, or between them, by a robot with a single one."""
    return None if len(robot.drive_axes) > 1 else f"{robot.name!r} has one drive axis, of which {effect.id} has a law"


def _asymmetry(effect: Effect, name: str) -> dict[str, Parameter]:
    """A share that is more one way and less the other: beyond all of it friction would drive."""
    return {effect.key(name): Parameter(0.0, "", free=True, lower=-1.0, upper=1.0, typical=0.1, source="catalogue")}


class OneAsymmetry(Effect):
    """An asymmetry that all drive axes have."""

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return _asymmetry(self, "asymmetry")

    def asymmetries(self, robot: Robot, p: Numbers) -> Scalars:
        """One for each drive axis."""
        return (p[self.key("asymmetry")],) * len(robot.drive_axes)


class AsymmetryPerAxis(OneAsymmetry):
    """An asymmetry of each drive axis."""

    def refusal(self, robot: Robot) -> str | None:
        return has_one_axis(self, robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in axis_names(robot):
            found |= _asymmetry(self, f"asymmetry_{name}")
        return found

    def asymmetries(self, robot: Robot, p: Numbers) -> Scalars:
        return tuple(p[self.key(f"asymmetry_{name}")] for name in axis_names(robot))
