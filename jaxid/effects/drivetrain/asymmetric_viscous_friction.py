"""Viscous friction that differs between forward and backward (Janot, Gautier and Brunot, 2019: EMPS), or between the wheels."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import axis_names, signed

WAYS = ("forward", "backward")


def differs_by_way(curve: Curve, robot: Robot) -> bool:
    """Whether a curve for either way (`WAYS`) of each of the robot's axes differs between the ways more than it bends alike
    both ways, which is a law of friction that no direction changes. What is constant or proportional to the speed both ways
    is the robot's own Coulomb and viscous friction."""
    p, share, one_way, both = robot.parameters.numbers, np.linspace(0.0, 1.0, 51), 0.0, 0.0
    own = np.stack([np.ones_like(share), share], axis=1)
    for part in curve.parts(robot) if curve.apart else ("",):
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


@dataclass(frozen=True)
class AsymmetricViscousFriction(Effect):
    """Viscous coefficients `B (1 + asymmetry)` forwards and `B (1 - asymmetry)` backwards."""

    id: ClassVar[str] = "asymmetric_viscous_friction"
    law: ClassVar[str] = "all_axes"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "B' = B (1 + asymmetry sgn s)"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "asymmetry", "", 0.1)

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed = list(resistance)
        for axis in robot.drive_axes:
            changed[axis] = resistance[axis] * (1.0 + p[self.key("asymmetry")] * jnp.sign(speeds[axis]))
        return tuple(changed)


@dataclass(frozen=True)
class ViscousAsymmetryOfEach(AsymmetricViscousFriction):
    """Every drive axis with an asymmetry of its own."""

    law: ClassVar[str] = "per_axis"
    formula: ClassVar[str] = "B_i' = B_i (1 + asymmetry_i sgn s_i)"

    def refusal(self, robot: Robot) -> str | None:
        return None if len(robot.drive_axes) > 1 else f"{robot.name!r} has one drive axis, of which {self.id} has a law"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for k in range(len(robot.drive_axes)):
            found |= signed(self, f"asymmetry_{k + 1}", "", 0.1)
        return found

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed = list(resistance)
        for k, axis in enumerate(robot.drive_axes):
            changed[axis] = resistance[axis] * (1.0 + p[self.key(f"asymmetry_{k + 1}")] * jnp.sign(speeds[axis]))
        return tuple(changed)


@dataclass(frozen=True)
class ViscousBetweenAxes(Effect):
    """One wheel that turns less easily than the others: a worn bearing, another tyre."""

    id: ClassVar[str] = "asymmetric_viscous_friction"
    law: ClassVar[str] = "between_axes"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "B_i' = B_i (1 + difference_i), the differences adding up to zero"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)

    def refusal(self, robot: Robot) -> str | None:
        ones = (1.0,) * len(robot.drive_axes)
        if len(ones) < 2:
            return f"{robot.name!r} has one drive axis, which cannot differ from others"

        def viscous(state: State, numbers: Numbers) -> list[float]:
            # At the speeds that belong to the states, of which none is zero.
            moving = {name: 1.0 + 0.1 * k for k, name in enumerate(state)}
            resistance = robot.own_viscous(robot.rubbing(moving, numbers), moving, numbers)
            return [float(resistance[axis]) for axis in robot.drive_axes]

        apart = apart_already(robot, viscous)
        return f"the drive axes of {robot.name!r} have viscous friction each of its own" if apart else None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return differences(self, robot)

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed = list(resistance)
        for axis, share in zip(robot.drive_axes, shares(self, robot, p), strict=True):
            changed[axis] = resistance[axis] * share
        return tuple(changed)


@dataclass(frozen=True)
class AsymmetryCurve(Curve):
    """What friction has more of than its straight line, a curve of the speed at the rim for either way."""

    id: ClassVar[str] = "asymmetric_viscous_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "F = B s + more_way(|s|) sgn s, the way being forward or backward"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.1, 0.4, 0.7, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3, 4)
    variable: ClassVar[str] = "|speed|"

    kinds: ClassVar[tuple[str, ...]] = WAYS

    def parts(self, robot: Robot) -> tuple[str, ...]:
        return axis_names(robot)

    def agrees(self, robot: Robot) -> bool:
        return differs_by_way(self, robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, typical = robot.friction_unit, 0.01 * robot.scales.friction
        return self.heights_and_reach(robot, unit, typical, robot.rim_unit, robot.scales.speed)

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        rims, levers, changed = robot.rim_speeds(speeds, p), robot.rim_levers(p), list(resistance)
        first = levers[robot.drive_axes[0]]
        for name, axis in zip(axis_names(robot), robot.drive_axes, strict=True):
            forward, backward = (self.at(jnp.abs(rims[axis]), p, self.of(name, way)) for way in WAYS)
            more = jnp.where(rims[axis] > 0.0, forward, -backward)
            changed[axis] = resistance[axis] + (more if levers[axis] is first else more * (levers[axis] / first))
        return tuple(changed)


LAWS: tuple[Effect, ...] = (
    AsymmetricViscousFriction(),
    ViscousAsymmetryOfEach(),
    ViscousBetweenAxes(),
    AsymmetryCurve(),
)
