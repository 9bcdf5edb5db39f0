"""Viscous friction that is not proportional to the speed: Armstrong-Hélouvry, Control of Machines with Friction (1991);
MuJoCo's polynomial damping."""

import operator
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ..curve import Curve, falls_at_once
from ..effect_parameters import axis_names, positive, shape, signed
from .by_axis import at_rims, on_drive_axes


@dataclass(frozen=True)
class SublinearViscousFriction(Effect):
    """Viscous friction `B s (|s| / reference)^-deficit`: it grows slower than the speed.

    The fixed `reference` is the speed at which B stays what it is.
    """

    id: ClassVar[str] = "sublinear_viscous_friction"
    law: ClassVar[str] = "power"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "F = B s (|s| / reference)^-deficit"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)

    @property
    def freer(self) -> Effect | None:
        return AddedPower(stands_as=self.stands_as)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        reference = shape(self, "reference", robot.rim_unit, 0.5 * robot.scales.speed, free=False)
        return signed(self, "deficit", "", 0.1) | reference

    def share(self, rim: Scalar, p: Numbers) -> Scalar:
        """What the viscous friction is multiplied with at a speed at the rim."""
        # Half the logarithm of s², kept finite at standstill where the friction itself vanishes.
        logarithm = 0.5 * jnp.log((rim / p[self.key("reference")]) ** 2 + 1e-8)
        return jnp.exp(-p[self.key("deficit")] * logarithm)

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        rims, changed = robot.rim_speeds(speeds, p), list(resistance)
        for axis in robot.drive_axes:
            changed[axis] = resistance[axis] * self.share(rims[axis], p)
        return tuple(changed)


@dataclass(frozen=True)
class CubicViscousFriction(SublinearViscousFriction):
    """Viscous friction with a cubic term: less than proportional where `curvature` is negative, more where positive."""

    law: ClassVar[str] = "cubic"
    formula: ClassVar[str] = "F = B s (1 + curvature (s / reference)^2)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        reference = shape(self, "reference", robot.rim_unit, 0.5 * robot.scales.speed, free=False)
        return signed(self, "curvature", "", 0.1) | reference

    def share(self, rim: Scalar, p: Numbers) -> Scalar:
        return 1.0 + p[self.key("curvature")] * (rim / p[self.key("reference")]) ** 2


@dataclass(frozen=True)
class SaturatingViscousFriction(SublinearViscousFriction):
    """Viscous friction that levels off: `B speed tanh(s / speed)` with `inverse_speed = 1 / speed`, zero for none."""

    law: ClassVar[str] = "tanh"
    formula: ClassVar[str] = "F = B speed tanh(s / speed), speed = 1 / inverse_speed"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "inverse_speed", f"s/{robot.rim_unit.split('/')[0]}", 1.0 / robot.scales.speed)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return tuple(Probe({self.key("inverse_speed"): size / robot.scales.speed}) for size in (1.0, 2.5, 6.0, 15.0))

    def share(self, rim: Scalar, p: Numbers) -> Scalar:
        x = rim * p[self.key("inverse_speed")]
        near = jnp.abs(x) < 1e-3  # where the quotient is 0 / 0
        return jnp.where(near, 1.0 - x * x / 3.0, jnp.tanh(x) / jnp.where(near, 1.0, x))


@dataclass(frozen=True)
class AddedPower(Effect):
    """A power of the speed beside the viscous friction, which stays what it is, to see whether that hangs on the form."""

    id: ClassVar[str] = "sublinear_viscous_friction"
    law: ClassVar[str] = "added_power"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "F = B s + size (|s| / reference)^exponent sgn s"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.02 * robot.scales.friction
        size = Parameter(typical, robot.friction_unit, free=True, typical=typical, source="form")
        exponent = Parameter(0.5, "", free=True, lower=0.1, upper=4.0, typical=0.5, source="form")
        reference = shape(self, "reference", robot.rim_unit, 0.5 * robot.scales.speed, free=False)
        return {self.key("size"): size, self.key("exponent"): exponent} | reference

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        rims = robot.rim_speeds(speeds, p)
        bends = []
        for axis in robot.drive_axes:
            share = rims[axis] / p[self.key("reference")]
            # Straight within a thousandth of the reference, where a root is endlessly steep.
            rise = jnp.exp(0.5 * (p[self.key("exponent")] - 1.0) * jnp.log(share**2 + 1e-6))
            bends.append(p[self.key("size")] * share * rise)
        return on_drive_axes(robot, resistance, at_rims(robot, p, bends), operator.add)


@dataclass(frozen=True)
class ViscousCurve(Curve):
    """How far the friction of every drive axis is from a straight line, as a curve of its speed at the rim.

    What of it is proportional to the speed is the viscous coefficient's, where that is estimated.
    """

    id: ClassVar[str] = "sublinear_viscous_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "F = B s + bend(|s|) sgn s"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.15, 0.4, 0.7, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3, 4)
    variable: ClassVar[str] = "|speed|"
    rather: ClassVar[str] = "stribeck_friction"

    def agrees(self, robot: Robot) -> bool:
        """Whether it bends with the speed, and is no friction that rises towards standstill."""
        parts = self.parts(robot) if self.apart else ("",)
        speeds = np.linspace(0.0, robot.parameters[self.key("reach")].value, 101)
        numbers = robot.parameters.numbers
        bend = np.sum([np.asarray(self.at(speeds, numbers, self.of(part))) for part in parts], axis=0)
        return not falls_at_once(speeds, bend)

    def doubt(self, robot: Robot) -> str:
        return self.limits(robot, robot.scales.rim_fastest_of, robot.rim_unit)

    def parts(self, robot: Robot) -> tuple[str, ...]:
        return axis_names(robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, typical = robot.friction_unit, 0.01 * robot.scales.friction
        return self.heights_and_reach(robot, unit, typical, robot.rim_unit, robot.scales.rim_reach)

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        rims = robot.rim_speeds(speeds, p)
        bends = [
            self.at(jnp.abs(rims[axis]), p, self.of(name)) * jnp.sign(rims[axis])
            for name, axis in zip(axis_names(robot), robot.drive_axes, strict=True)
        ]
        return on_drive_axes(robot, resistance, at_rims(robot, p, bends), operator.add)


LAWS: tuple[Effect, ...] = (
    SublinearViscousFriction(),
    CubicViscousFriction(),
    SaturatingViscousFriction(),
    ViscousCurve(),
)
