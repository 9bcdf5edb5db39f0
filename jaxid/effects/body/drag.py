"""Resistance of the body's translation that grows faster than its speed."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import signed


def whole_speed(state: State, robot: Robot) -> Scalar:
    """The size of the body's velocity."""
    linear = robot.translations
    if len(linear) == 1:
        return jnp.abs(state[linear[0]])
    # The small number keeps the derivative of the root finite at standstill.
    return jnp.sqrt(sum(state[name] ** 2 for name in linear) + 1e-300)


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

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "coefficient", drag_unit(robot), 0.025 * robot.scales.force / robot.scales.speed**2)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        per_speed = p[self.key("coefficient")] * whole_speed(state, robot)
        return against(forces, {name: per_speed * state[name] for name in robot.translations}, robot)


@dataclass(frozen=True)
class DragOfEach(QuadraticDrag):
    """Every translation with a drag of its own, by its own speed."""

    law: ClassVar[str] = "per_axis"
    formula: ClassVar[str] = "F_i = -coefficient_i v_i |v_i|"

    def refusal(self, robot: Robot) -> str | None:
        several = len(robot.translations) > 1
        return None if several else f"{robot.name!r} has one translation, of which {self.id} has a law"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in robot.translations:
            typical = 0.025 * robot.scales.force / robot.scales.speed**2
            found |= signed(self, f"coefficient_{name}", drag_unit(robot), typical)
        return found

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        each = {n: p[self.key(f"coefficient_{n}")] * jnp.abs(state[n]) * state[n] for n in robot.translations}
        return against(forces, each, robot)


@dataclass(frozen=True)
class DragCurve(Curve):
    """How far the resistance of the translation is from a straight line, as a curve of the speed."""

    id: ClassVar[str] = "quadratic_drag"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "F = -bend(|v|) v / |v|"
    needs: ClassVar[tuple[str, ...]] = ("translation",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.25, 0.5, 0.75, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3, 4)
    variable: ClassVar[str] = "|v|"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        name = robot.translations[0]
        unit, fastest = robot.force_unit(name), robot.scales.output(name)
        return self.heights_and_reach(robot, unit, 0.01 * robot.scales.force, robot.velocity_unit(name), fastest)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        speed = whole_speed(state, robot)
        per_speed = self.at(speed, p) / (speed + 1e-9 * p[self.key("reach")])
        return against(forces, {name: per_speed * state[name] for name in robot.translations}, robot)


def drag_unit(robot: Robot) -> str:
    """Unit of a force over a speed squared, for the robot's first translation."""
    name = robot.translations[0]
    per = robot.velocity_unit(name).split("/")[0].split(" or ")[0] or "m"
    return f"{robot.force_unit(name)} s^2/{per}^2"


LAWS: tuple[Effect, ...] = (QuadraticDrag(), DragOfEach(), DragCurve())
