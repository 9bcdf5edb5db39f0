"""Viscous friction that differs between forward and backward (Janot, Gautier and Brunot, 2019: EMPS), or between the wheels."""

import operator
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import PER_AXIS, WAYS, axis_names
from .by_axis import (
    AsymmetryPerAxis,
    OneAsymmetry,
    apart_already,
    at_rims,
    differences,
    differs_by_way,
    has_one_axis,
    on_drive_axes,
    shares,
)


@dataclass(frozen=True)
class AsymmetricViscousFriction(OneAsymmetry):
    """Viscous coefficients `B (1 + asymmetry)` forwards and `B (1 - asymmetry)` backwards."""

    id: ClassVar[str] = "asymmetric_viscous_friction"
    law: ClassVar[str] = "all_axes"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "B' = B (1 + asymmetry sgn s)"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        signs = (jnp.sign(speeds[axis]) for axis in robot.drive_axes)
        factors = [1.0 + a * sign for a, sign in zip(self.asymmetries(robot, p), signs, strict=True)]
        return on_drive_axes(robot, resistance, factors, operator.mul)


@dataclass(frozen=True)
class ViscousAsymmetryOfEach(AsymmetryPerAxis, AsymmetricViscousFriction):
    """Every drive axis with an asymmetry of its own."""

    law: ClassVar[str] = PER_AXIS
    formula: ClassVar[str] = "B_i' = B_i (1 + asymmetry_i sgn s_i)"


@dataclass(frozen=True)
class ViscousBetweenAxes(Effect):
    """One wheel that turns less easily than the others: a worn bearing, another tyre."""

    id: ClassVar[str] = "asymmetric_viscous_friction"
    law: ClassVar[str] = "between_axes"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "B_i' = B_i (1 + difference_i), the differences adding up to zero"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)

    def refusal(self, robot: Robot) -> str | None:
        if alone := has_one_axis(self, robot):
            return alone

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
        return on_drive_axes(robot, resistance, shares(self, robot, p), operator.mul)


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

    def doubt(self, robot: Robot) -> str:
        return self.limits(robot, robot.scales.rim_fastest_of, robot.rim_unit)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, typical = robot.friction_unit, 0.01 * robot.scales.friction
        return self.heights_and_reach(robot, unit, typical, robot.rim_unit, robot.scales.rim_reach)

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        rims, more = robot.rim_speeds(speeds, p), []
        for name, axis in zip(axis_names(robot), robot.drive_axes, strict=True):
            forward, backward = (self.at(jnp.abs(rims[axis]), p, self.of(name, way)) for way in WAYS)
            more.append(jnp.where(rims[axis] > 0.0, forward, -backward))
        return on_drive_axes(robot, resistance, at_rims(robot, p, more), operator.add)


LAWS: tuple[Effect, ...] = (
    AsymmetricViscousFriction(),
    ViscousAsymmetryOfEach(),
    ViscousBetweenAxes(),
    AsymmetryCurve(),
)
