"""Viscous friction that differs between forward and backward (Janot, Gautier and Brunot, 2019: EMPS)."""

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


LAWS: tuple[Effect, ...] = (AsymmetricViscousFriction(), ViscousAsymmetryOfEach(), AsymmetryCurve())
