"""Friction that rises near standstill (Stribeck): Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994);
Olsson, Åström, Canudas de Wit, Gäfvert and Lischinsky, European Journal of Control 4 (1998)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Levels, Numbers, Scalar, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import PER_AXIS, axis_names, positive, shape
from .by_axis import rubbing_more

_SPEEDS = (0.02, 0.05, 0.12)
"""Speeds of falling off that are tried, in shares of the robot's."""


def gaussian(share: Scalar) -> Scalar:
    """The excess left at a `share` of the speed within which it falls off."""
    return jnp.exp(-(share**2))


def risen(
    levels: Levels,
    axes: Sequence[int],
    speeds: Scalars,
    p: Numbers,
    robot: Robot,
    amplitude: Scalar,
    speed: Scalar,
    left: Callable[[Scalar], Scalar] = gaussian,
) -> Levels:
    """Coulomb levels of the `axes` higher by `amplitude` at standstill, of which `left` is left at a share of the `speed` at
    the rim."""
    rims, levers, changed = robot.rim_speeds(speeds, p), robot.rim_levers(p), list(levels)
    for axis in axes:
        rise = amplitude * left(rims[axis] / speed)
        if levers[axis] is not levers[axes[0]]:
            rise = rise * (levers[axis] / levers[axes[0]])  # an axis with another lever: the same force at the rim
        backward, forward = levels[axis]
        changed[axis] = (backward + rise, forward + rise)
    return tuple(changed)


@dataclass(frozen=True)
class StribeckFriction(Effect):
    """Coulomb level higher by `amplitude` at standstill, the excess falling off as a Gaussian of the speed (Stribeck)."""

    id: ClassVar[str] = "stribeck_friction"
    upon: ClassVar[str] = "coulomb_friction"
    law: ClassVar[str] = "gaussian"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = C + amplitude * exp(-(s / speed)^2)"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)
    finer: ClassVar[float] = 2.0  # friction falls off within a step or two of starting to slide

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.02 * robot.scales.friction
        return positive(self, "amplitude", robot.friction_unit, typical) | self._speed(robot)

    def _speed(self, robot: Robot) -> dict[str, Parameter]:
        return shape(self, "speed", robot.rim_unit, 0.05 * robot.scales.speed)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        speed = self.key("speed")
        strengths = {name: robot.parameters[name].typical or 1.0 for name in self.parameters(robot) if name != speed}
        return tuple(Probe(strengths, {speed: share * robot.scales.speed}) for share in _SPEEDS)

    def left(self, share: Scalar) -> Scalar:
        """The excess left at a share of the speed."""
        return gaussian(share)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        amplitude, speed = p[self.key("amplitude")], p[self.key("speed")]
        return risen(levels, robot.drive_axes, speeds, p, robot, amplitude, speed, self.left)


@dataclass(frozen=True)
class Exponential(StribeckFriction):
    """The excess falls off exponentially (Bo and Pavelescu, Wear 82, 1982, with exponent 1)."""

    law: ClassVar[str] = "exponential"
    formula: ClassVar[str] = "C' = C + amplitude * exp(-|s| / speed)"

    def left(self, share: Scalar) -> Scalar:
        return jnp.exp(-jnp.abs(share))


@dataclass(frozen=True)
class Lorentzian(StribeckFriction):
    """The excess falls off as 1 / (1 + (s / speed)^2) (Hess and Soom, ASME Journal of Tribology 112, 1990)."""

    law: ClassVar[str] = "lorentzian"
    formula: ClassVar[str] = "C' = C + amplitude / (1 + (s / speed)^2)"

    def left(self, share: Scalar) -> Scalar:
        return 1.0 / (1.0 + share**2)


@dataclass(frozen=True)
class Hyperbolic(StribeckFriction):
    """The excess falls off as 1 / (1 + |s| / speed), with a long tail (Popp and Stelter, Philosophical Transactions of the
    Royal Society A 332, 1990)."""

    law: ClassVar[str] = "hyperbolic"
    formula: ClassVar[str] = "C' = C + amplitude / (1 + |s| / speed)"

    def left(self, share: Scalar) -> Scalar:
        return 1.0 / (1.0 + jnp.abs(share))


@dataclass(frozen=True)
class StretchedExponential(StribeckFriction):
    """The excess falls off as exp(-sqrt(|s| / speed)): Bo and Pavelescu's law with exponent 1/2."""

    law: ClassVar[str] = "exponent_one_half"
    formula: ClassVar[str] = "C' = C + amplitude * exp(-sqrt(|s| / speed))"

    def left(self, share: Scalar) -> Scalar:
        # The small number keeps the derivative of the root finite at standstill.
        return jnp.exp(-jnp.sqrt(jnp.abs(share) + 1e-6))


@dataclass(frozen=True)
class Relative(StribeckFriction):
    """Every axis rises by the same share of its own Coulomb level."""

    law: ClassVar[str] = "share_of_coulomb"
    formula: ClassVar[str] = "C_i' = C_i (1 + share * exp(-(s_i / speed)^2))"

    def refusal(self, robot: Robot) -> str | None:
        return None if len(robot.drive_axes) > 1 else f"{robot.name!r} has one drive axis, of which {self.id} has a law"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "share", "", 0.3) | self._speed(robot)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        rims, changed = robot.rim_speeds(speeds, p), list(levels)
        for axis in robot.drive_axes:
            factor = 1.0 + p[self.key("share")] * gaussian(rims[axis] / p[self.key("speed")])
            changed[axis] = (levels[axis][0] * factor, levels[axis][1] * factor)
        return tuple(changed)


@dataclass(frozen=True)
class OfEachAxis(StribeckFriction):
    """Every drive axis rises by an amplitude of its own."""

    law: ClassVar[str] = PER_AXIS
    formula: ClassVar[str] = "C_i' = C_i + amplitude_i * exp(-(s_i / speed)^2)"

    def refusal(self, robot: Robot) -> str | None:
        return None if len(robot.drive_axes) > 1 else f"{robot.name!r} has one drive axis, of which {self.id} has a law"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for k in range(len(robot.drive_axes)):
            found |= positive(self, f"amplitude_{k + 1}", robot.friction_unit, 0.02 * robot.scales.friction)
        return found | self._speed(robot)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        rims, changed = robot.rim_speeds(speeds, p), list(levels)
        for k, axis in enumerate(robot.drive_axes):
            rise = p[self.key(f"amplitude_{k + 1}")] * gaussian(rims[axis] / p[self.key("speed")])
            changed[axis] = (levels[axis][0] + rise, levels[axis][1] + rise)
        return tuple(changed)


@dataclass(frozen=True)
class StribeckCurve(Curve):
    """The excess as a curve of the speed at the rim, none beyond the reach."""

    id: ClassVar[str] = "stribeck_friction"
    upon: ClassVar[str] = "coulomb_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = C + excess(|s|)"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)
    finer: ClassVar[float] = 2.0
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.1, 0.25, 0.5, 1.0)
    free: ClassVar[tuple[int, ...]] = (0, 1, 2, 3)
    variable: ClassVar[str] = "|speed|"
    rather: ClassVar[str] = "sublinear_viscous_friction"
    reaches: ClassVar[tuple[float, ...]] = (0.3, 1.0)

    def agrees(self, robot: Robot) -> bool:
        """Whether it rises towards standstill: what falls there is friction that sets in with the speed."""
        parts = self.parts(robot) if self.apart else ("",)
        return sum(robot.parameters[self.height(0, self.of(part))].value for part in parts) >= 0.0

    def doubt(self, robot: Robot) -> str:
        """What falls towards standstill, at it and on the whole, is the contrary of it, beside whatever made it so. On the
        whole: over the speeds, since of many points that are close at standstill each is little known."""
        whole, places = 0.0, self.places
        for name in self.each(robot):
            varying = {k: robot.parameters[self.height(k, name)].value for k in self.varying}
            heights = [varying.get(k, 0.0) for k in range(len(places))]
            steps = zip(heights, heights[1:], places, places[1:], strict=False)
            whole += sum(0.5 * (a + b) * (to - at) for a, b, at, to in steps)
        return "its curve falls towards standstill" if whole < 0.0 and not self.agrees(robot) else ""

    def parts(self, robot: Robot) -> tuple[str, ...]:
        return axis_names(robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.02 * robot.scales.friction
        return self.heights_and_reach(robot, robot.friction_unit, typical, robot.rim_unit, 0.3 * robot.scales.speed)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        rims, axes = robot.rim_speeds(speeds, p), zip(axis_names(robot), robot.drive_axes, strict=True)
        rises = [self.at(jnp.abs(rims[axis]), p, self.of(name)) for name, axis in axes]
        return rubbing_more(robot, p, levels, rises, rises)


LAWS: tuple[Effect, ...] = (
    StribeckFriction(),
    Exponential(),
    Lorentzian(),
    Hyperbolic(),
    StretchedExponential(),
    Relative(),
    OfEachAxis(),
    StribeckCurve(),
)
