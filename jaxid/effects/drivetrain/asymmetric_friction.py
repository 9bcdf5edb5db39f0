"""Coulomb friction that differs between forward and backward (Janot, Gautier and Brunot, Nonlinear System Identification
Benchmarks, 2019: EMPS), or between the wheels."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Levels, Numbers, Scalars, State
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import axis_names, signed
from .asymmetric_viscous_friction import WAYS, apart_already, differences, differs_by_way, shares


@dataclass(frozen=True)
class AsymmetricFriction(Effect):
    """Coulomb levels `C (1 + asymmetry)` forwards and `C (1 - asymmetry)` backwards."""

    id: ClassVar[str] = "asymmetric_friction"
    upon: ClassVar[str] = "coulomb_friction"
    law: ClassVar[str] = "all_axes"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = C (1 + asymmetry sgn s)"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "asymmetry", "", 0.1)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        a, changed = p[self.key("asymmetry")], list(levels)
        for axis in robot.drive_axes:
            backward, forward = levels[axis]
            changed[axis] = (backward * (1.0 - a), forward * (1.0 + a))
        return tuple(changed)


@dataclass(frozen=True)
class AsymmetryOfEach(AsymmetricFriction):
    """Every drive axis with an asymmetry of its own: one wheel's gear, or the body's forward axis alone."""

    law: ClassVar[str] = "per_axis"
    formula: ClassVar[str] = "C_i' = C_i (1 + asymmetry_i sgn s_i)"

    def refusal(self, robot: Robot) -> str | None:
        return None if len(robot.drive_axes) > 1 else f"{robot.name!r} has one drive axis, of which {self.id} has a law"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for k in range(len(robot.drive_axes)):
            found |= signed(self, f"asymmetry_{k + 1}", "", 0.1)
        return found

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        changed = list(levels)
        for k, axis in enumerate(robot.drive_axes):
            a, (backward, forward) = p[self.key(f"asymmetry_{k + 1}")], levels[axis]
            changed[axis] = (backward * (1.0 - a), forward * (1.0 + a))
        return tuple(changed)


@dataclass(frozen=True)
class DryBetweenAxes(Effect):
    """One wheel that rubs more than the others: a brake that drags, a bearing."""

    id: ClassVar[str] = "asymmetric_friction"
    upon: ClassVar[str] = "coulomb_friction"
    law: ClassVar[str] = "between_axes"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C_i' = C_i (1 + difference_i), the differences adding up to zero"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)

    def refusal(self, robot: Robot) -> str | None:
        if len(robot.drive_axes) < 2:
            return f"{robot.name!r} has one drive axis, which cannot differ from others"

        def dry(state: State, numbers: Numbers) -> list[float]:
            levels = robot.own_coulomb(state, numbers)
            return [float(levels[axis][1]) for axis in robot.drive_axes]

        apart = apart_already(robot, dry)
        return f"the drive axes of {robot.name!r} have dry friction each of its own" if apart else None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return differences(self, robot)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        changed = list(levels)
        for axis, share in zip(robot.drive_axes, shares(self, robot, p), strict=True):
            backward, forward = levels[axis]
            changed[axis] = (backward * share, forward * share)
        return tuple(changed)


@dataclass(frozen=True)
class AsymmetryOfTheBody(Effect):
    """A force that resists forward and helps backward motion of the whole body, whatever its size; none at standstill."""

    id: ClassVar[str] = "asymmetric_friction"
    upon: ClassVar[str] = "coulomb_friction"
    law: ClassVar[str] = "forward_motion"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "F = -difference along the forward motion while it moves"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)

    def refusal(self, robot: Robot) -> str | None:
        apart = robot.turning and len(robot.drive_axes) == 2
        return None if apart else f"the drive axes of {robot.name!r} are its body's, of which {self.id} has laws"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "difference", robot.force_unit(robot.velocities[0]), 0.02 * robot.scales.force)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        v = state[robot.velocities[0]] / (0.02 * robot.scales.speed)
        return (forces[0] - p[self.key("difference")] * (1.0 - jnp.exp(-(v**2))), *forces[1:])


@dataclass(frozen=True)
class DryAsymmetryCurve(Curve):
    """What dry friction has more of, a curve of the speed at the rim for either way.

    What of it is the same at all speeds and both ways is the Coulomb friction's, where that is estimated.
    """

    id: ClassVar[str] = "asymmetric_friction"
    upon: ClassVar[str] = "coulomb_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = C + more_way(|s|), the way being forward or backward"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.3, 0.6, 1.0)
    free: ClassVar[tuple[int, ...]] = (0, 1, 2, 3)
    variable: ClassVar[str] = "|speed|"

    kinds: ClassVar[tuple[str, ...]] = WAYS

    def parts(self, robot: Robot) -> tuple[str, ...]:
        return axis_names(robot)

    def agrees(self, robot: Robot) -> bool:
        return differs_by_way(self, robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, typical = robot.friction_unit, 0.02 * robot.scales.friction
        return self.heights_and_reach(robot, unit, typical, robot.rim_unit, robot.scales.speed)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        rims, levers, changed = robot.rim_speeds(speeds, p), robot.rim_levers(p), list(levels)
        first = levers[robot.drive_axes[0]]
        for name, axis in zip(axis_names(robot), robot.drive_axes, strict=True):
            ahead, back = (self.at(jnp.abs(rims[axis]), p, self.of(name, way)) for way in WAYS)
            if levers[axis] is not first:
                ahead, back = ahead * (levers[axis] / first), back * (levers[axis] / first)
            backward, forward = levels[axis]
            changed[axis] = (jnp.maximum(backward + back, 0.0), jnp.maximum(forward + ahead, 0.0))
        return tuple(changed)


LAWS: tuple[Effect, ...] = (
    AsymmetricFriction(),
    AsymmetryOfEach(),
    DryBetweenAxes(),
    AsymmetryOfTheBody(),
    DryAsymmetryCurve(),
)
