"""Coulomb friction that differs between forward and backward (Janot, Gautier and Brunot, Nonlinear System Identification
Benchmarks, 2019: EMPS), or between the wheels."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Levels, Numbers, Scalars, State
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import PER_AXIS, WAYS, axis_names, signed, still
from .by_axis import (
    AsymmetryPerAxis,
    OneAsymmetry,
    apart_already,
    differences,
    differs_by_way,
    has_one_axis,
    on_drive_axes,
    rubbing_more,
    shares,
)

_ALL_BUT_NONE = 0.9
"""Asymmetry from which a gear would hardly rub one way."""


@dataclass(frozen=True)
class AsymmetricFriction(OneAsymmetry):
    """Coulomb levels `C (1 + asymmetry)` forwards and `C (1 - asymmetry)` backwards."""

    id: ClassVar[str] = "asymmetric_friction"
    upon: ClassVar[str] = "coulomb_friction"
    law: ClassVar[str] = "all_axes"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = C (1 + asymmetry sgn s)"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)

    def doubt(self, robot: Robot) -> str:
        """No gear rubs one way alone: where friction all but vanishes the other way, it stands for a push."""
        most = max(map(abs, self.asymmetries(robot, robot.parameters.numbers)), default=0.0)
        if most < _ALL_BUT_NONE:
            return ""
        little, much = (f"{100.0 * (1.0 + sign * most):.0f} %" for sign in (-1.0, 1.0))
        return (
            f"dry friction that is {little} of the usual one way and {much} the other is none of a gear's; a force that pushes "
            "the robot one way looks so while it moves"
        )

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        return on_drive_axes(
            robot, levels, self.asymmetries(robot, p), lambda level, a: (level[0] * (1.0 - a), level[1] * (1.0 + a))
        )


@dataclass(frozen=True)
class AsymmetryOfEach(AsymmetryPerAxis, AsymmetricFriction):
    """Every drive axis with an asymmetry of its own: one wheel's gear, or the body's forward axis alone."""

    law: ClassVar[str] = PER_AXIS
    formula: ClassVar[str] = "C_i' = C_i (1 + asymmetry_i sgn s_i)"


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
        if alone := has_one_axis(self, robot):
            return alone

        def dry(state: State, numbers: Numbers) -> list[float]:
            levels = robot.own_coulomb(state, numbers)
            return [float(levels[axis][1]) for axis in robot.drive_axes]

        apart = apart_already(robot, dry)
        return f"the drive axes of {robot.name!r} have dry friction each of its own" if apart else None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return differences(self, robot)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        return _apart(self, levels, p, robot)


def _apart(effect: Effect, levels: Levels, p: Numbers, robot: Robot) -> Levels:
    """`levels` with the `differences` of the effect."""
    return on_drive_axes(
        robot, levels, shares(effect, robot, p), lambda level, share: (level[0] * share, level[1] * share)
    )


@dataclass(frozen=True)
class DryOfEach(AsymmetryOfEach):
    """Every drive axis with a level of its own either way."""

    law: ClassVar[str] = "per_axis_and_between"
    formula: ClassVar[str] = (
        "C_i' = C_i (1 + difference_i) (1 + asymmetry_i sgn s_i), the differences adding up to zero"
    )

    def refusal(self, robot: Robot) -> str | None:
        return DryBetweenAxes().refusal(robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return differences(self, robot) | super().parameters(robot)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        return super().dry(_apart(self, levels, p, robot), speeds, state, p, robot)


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
        forwards = robot.velocities[0]
        difference = signed(self, "difference", robot.force_unit(forwards), 0.02 * robot.scales.force)
        return difference | still(self, robot.velocity_unit(forwards), 0.02 * robot.scales.speed)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        v = state[robot.velocities[0]] / p[self.key("still")]
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

    def doubt(self, robot: Robot) -> str:
        return self.limits(robot, robot.scales.rim_fastest_of, robot.rim_unit)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, typical = robot.friction_unit, 0.02 * robot.scales.friction
        return self.heights_and_reach(robot, unit, typical, robot.rim_unit, robot.scales.rim_reach)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        rims = robot.rim_speeds(speeds, p)
        axes = [*zip(axis_names(robot), robot.drive_axes, strict=True)]
        forward, backward = (
            [self.at(jnp.abs(rims[axis]), p, self.of(name, way)) for name, axis in axes] for way in WAYS
        )
        return rubbing_more(robot, p, levels, backward, forward)


LAWS: tuple[Effect, ...] = (
    AsymmetricFriction(),
    AsymmetryOfEach(),
    DryBetweenAxes(),
    DryOfEach(),
    AsymmetryOfTheBody(),
    DryAsymmetryCurve(),
)
