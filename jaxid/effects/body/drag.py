"""Resistance of the body's translation that grows faster than its speed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.robot import Robot
from ..curve import Curve, falls_at_once
from ..effect_parameters import PER_AXIS, per_speed, positive, shape, signed

_SQUARE = 2.0
"""Exponent of quadratic drag."""
_MUCH = 0.5
"""Share of the largest height of all curves from which a step of one is more than what another's errors make."""


def whole_speed(along: Scalars) -> Scalar:
    """The size of the body's velocity."""
    if len(along) == 1:
        return jnp.abs(along[0])
    # The small number keeps the derivative of the root finite at standstill.
    return jnp.sqrt(sum(speed**2 for speed in along) + 1e-300)


def against(forces: Scalars, resisting: dict[str, Scalar], robot: Robot) -> Scalars:
    """`forces` less what resists each of the named velocities."""
    changed = list(forces)
    for name, force in resisting.items():
        changed[robot.velocities.index(name)] = changed[robot.velocities.index(name)] - force
    return tuple(changed)


@dataclass(frozen=True)
class QuadraticDrag(Effect):
    """Drag `-coefficient v |v|` on the body's translation."""

    id: ClassVar[str] = "quadratic_drag"
    law: ClassVar[str] = "whole_speed"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "F = -coefficient v |v|"
    needs: ClassVar[tuple[str, ...]] = ("translation",)

    def refusal(self, robot: Robot) -> str | None:
        if len(robot.translations) < 2 or robot.in_plane or robot.turns:
            return None
        return f"the velocities of {robot.name!r} are of parts that move against each other, and none a whole one's"

    @property
    def freer(self) -> Effect | None:
        return DragOfAnyPower(stands_as=self.stands_as)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "coefficient", drag_unit(robot), 0.025 * robot.scales.force / robot.scales.speed**2)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        along = robot.along(state, p)
        per_speed = p[self.key("coefficient")] * whole_speed(along)
        return robot.pushed(forces, tuple(-per_speed * speed for speed in along), p)


def _exponent(effect: Effect) -> dict[str, Parameter]:
    """A free exponent, away from that of the viscous friction."""
    return {
        effect.key("exponent"): Parameter(_SQUARE, "", free=True, lower=1.05, upper=4.0, typical=_SQUARE, source="form")
    }


def _bent(speed: Scalar, fastest: Scalar, effect: Effect, p: Numbers) -> Scalar:
    """What drag with another exponent is, of that which grows with the square: the same at the speed `fastest`."""
    logarithm = 0.5 * jnp.log((speed / fastest) ** 2 + 1e-8)
    return jnp.exp((p[effect.key("exponent")] - _SQUARE) * logarithm)


@dataclass(frozen=True)
class DragOfAnyPower(QuadraticDrag):
    """The same with any exponent: for the question whether the viscous friction beside it hangs on that."""

    law: ClassVar[str] = "any_power"
    restricts: ClassVar[Mapping[str, float]] = MappingProxyType({"exponent": _SQUARE})
    formula: ClassVar[str] = "F = -coefficient v |v| (|v| / fastest)^(exponent - 2)"

    @property
    def freer(self) -> Effect | None:
        return None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        name = _ahead(robot)
        fastest = shape(self, "fastest", robot.velocity_unit(name), robot.scales.output(name), free=False)
        return super().parameters(robot) | _exponent(self) | fastest

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        along = robot.along(state, p)
        speed = whole_speed(along)
        per_speed = p[self.key("coefficient")] * speed * _bent(speed, p[self.key("fastest")], self, p)
        return robot.pushed(forces, tuple(-per_speed * one for one in along), p)


@dataclass(frozen=True)
class DragOfEach(QuadraticDrag):
    """Every speed of the body, its yaw rate among them, with a drag of its own."""

    law: ClassVar[str] = PER_AXIS
    formula: ClassVar[str] = "F_i = -coefficient_i v_i |v_i|"

    def refusal(self, robot: Robot) -> str | None:
        if not robot.translations:
            return f"{robot.name!r} has the speeds of wheels, and none of its body's"
        several = len(robot.velocities) > 1
        return None if several else f"{robot.name!r} has one velocity, of which {self.id} has a law"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in robot.velocities:
            typical = 0.025 * largest_force(robot, name) / robot.scales.output(name) ** 2
            found |= positive(self, f"coefficient_{name}", drag_unit(robot, name), typical)
        return found

    @property
    def freer(self) -> Effect | None:
        return DragOfEachOfAnyPower(stands_as=self.stands_as)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        each = {n: p[self.key(f"coefficient_{n}")] * jnp.abs(state[n]) * state[n] for n in robot.velocities}
        return against(forces, each, robot)


@dataclass(frozen=True)
class DragOfEachOfAnyPower(DragOfEach):
    """The same with any exponent, as `DragOfAnyPower`."""

    law: ClassVar[str] = "any_power_per_axis"
    restricts: ClassVar[Mapping[str, float]] = MappingProxyType({"exponent": _SQUARE})
    formula: ClassVar[str] = "F_i = -coefficient_i v_i |v_i| (|v_i| / fastest_i)^(exponent - 2)"

    @property
    def freer(self) -> Effect | None:
        return None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found = super().parameters(robot) | _exponent(self)
        for name in robot.velocities:
            found |= shape(self, f"fastest_{name}", robot.velocity_unit(name), robot.scales.output(name), free=False)
        return found

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        each = {}
        for name in robot.velocities:
            v, fastest = state[name], p[self.key(f"fastest_{name}")]
            each[name] = p[self.key(f"coefficient_{name}")] * jnp.abs(v) * v * _bent(v, fastest, self, p)
        return against(forces, each, robot)


@dataclass(frozen=True)
class DragCurve(Curve):
    """How far the resistance of the translation is from a straight line, as a curve of the speed; apart, that of every
    velocity, as a curve of its own speed."""

    id: ClassVar[str] = "quadratic_drag"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "F = -bend(|v|) v / |v|"
    needs: ClassVar[tuple[str, ...]] = ("translation",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.25, 0.5, 0.75, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3, 4)
    variable: ClassVar[str] = "|v|"
    rather: ClassVar[str] = "stribeck_friction"

    def agrees(self, robot: Robot) -> bool:
        """Whether it grows with the speed, and is no friction that rises towards standstill."""
        speeds, numbers = np.linspace(0.0, robot.parameters[self.key("reach")].value, 101), robot.parameters.numbers
        parts = [self.of(part) for part in robot.translations] if self.apart else [""]
        return not falls_at_once(speeds, np.sum([np.asarray(self.at(speeds, numbers, part)) for part in parts], axis=0))

    def doubt(self, robot: Robot) -> str:
        """What is there as soon as a speed is, and much of all that the curves say, is dry friction's: of an axis for which
        that has no name, say. What is there at the fastest alone, no fluid does."""
        numbers, table = robot.parameters.numbers, robot.parameters
        speeds = np.linspace(0.0, table[self.key("reach")].value, 101)
        curves = {name: np.asarray(self.at(speeds, numbers, name)) for name in self.each(robot)}
        least = _MUCH * max(float(np.max(np.abs(curve))) for curve in curves.values())
        falling = [name for name, own in curves.items() if falls_at_once(speeds, own) and -np.min(own) > least]
        if falling:
            return f"its curve{_of(falling)} is a step at standstill, as dry friction is"
        return self.limits(robot, lambda _: speeds[-1], robot.velocity_unit(_ahead(robot)))

    def parts(self, robot: Robot) -> tuple[str, ...]:
        return robot.velocities if robot.translations else ()

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        name = _ahead(robot)
        unit, fastest = robot.force_unit(name), max(robot.scales.whole, robot.scales.reach(name))
        found = self.heights_and_reach(robot, unit, 0.01 * robot.scales.force, robot.velocity_unit(name), fastest)
        for part in (name for name in self.parts(robot) if self.apart and name not in robot.translations):
            typical, of = 0.01 * largest_force(robot, part), robot.velocity_unit(part)
            for place in self.varying:
                height = self.height(place, self.of(part)).removeprefix(self.key(""))
                found |= signed(self, height, robot.force_unit(part), typical)
            found |= shape(self, f"reach_{part}", of, robot.scales.reach(part), free=False)
        return found

    def _apart(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        each = {}
        for name in robot.velocities:
            speed, turned = jnp.abs(state[name]), self.key(f"reach_{name}")
            share = speed * (p[self.key("reach")] / p[turned]) if turned in p else speed
            each[name] = self.at(share, p, self.of(name)) * jnp.sign(state[name])
        return against(forces, each, robot)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        if self.apart:
            return self._apart(forces, state, p, robot)
        along = robot.along(state, p)
        speed = whole_speed(along)
        per_speed = self.at(speed, p) / (speed + 1e-9 * p[self.key("reach")])
        return robot.pushed(forces, tuple(-per_speed * one for one in along), p)


def _of(parts: Sequence[str]) -> str:
    names = " and ".join(part for part in parts if part)
    return f" of {names}" if names else ""


def _ahead(robot: Robot) -> str:
    """The velocity forwards, or one in its unit."""
    return (robot.translations or robot.velocities)[0]


def largest_force(robot: Robot, name: str) -> float:
    """About the largest force along a velocity: of a yaw rate, the moment that drives it."""
    if name in robot.translations:
        return robot.scales.force
    fastest = robot.scales.output(name)
    return robot.scales.force * robot.scales.speed / fastest if fastest > 0 else robot.scales.force


def drag_unit(robot: Robot, name: str = "") -> str:
    """Unit of a force over a speed squared, for one of the robot's velocities (the first translation)."""
    name = name or _ahead(robot)
    return per_speed(robot.force_unit(name), robot.velocity_unit(name).split(" or ")[0] or "m/s", 2)


LAWS: tuple[Effect, ...] = (QuadraticDrag(), DragOfEach(), DragCurve())
