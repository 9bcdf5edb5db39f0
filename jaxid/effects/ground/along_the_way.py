"""Dry friction that depends on the place along a way: a rail, a ball screw, a worn stretch of a gear."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Levels, Numbers, Scalars, State
from ...robots.robot import Robot
from ...robots.traits import traits_of
from ..curve import Curve
from ..effect_parameters import shape

_KNOTS = tuple(k / 6.0 for k in range(7))


@dataclass(frozen=True)
class FrictionAlongTheWay(Curve):
    """What dry friction has more of, a curve of how far the one drive axis is along its way; none in the middle of it, where
    Coulomb friction is all."""

    id: ClassVar[str] = "surface_change"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "C' = C + more(q - begin)"
    upon: ClassVar[str] = "coulomb_friction"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes", "wheel_angles")
    knots: ClassVar[tuple[float, ...]] = _KNOTS
    free: ClassVar[tuple[int, ...]] = (0, 1, 2, 4, 5, 6)
    variable: ClassVar[str] = "way from where the logs begin"
    wanders: ClassVar[bool] = True

    def refusal(self, robot: Robot) -> str | None:
        if "pose" in traits_of(robot) or len(robot.drive_axes) != 1 or len(robot.angles) != 1:
            return f"{robot.name!r} moves along no single way"
        return None

    def may_hold(self, robot: Robot) -> list[str]:
        return []

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        begin, end = robot.scales.way or (-robot.scales.length, robot.scales.length)
        found = self.heights_and_reach(
            robot, robot.friction_unit, 0.1 * robot.scales.friction, robot.angle_unit, end - begin
        )
        return found | shape(self, "begin", robot.angle_unit, begin, free=False)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        more = self.at(jnp.maximum(state[robot.angles[0]] - p[self.key("begin")], 0.0), p)
        (axis,), found = robot.drive_axes, list(levels)
        found[axis] = (jnp.maximum(levels[axis][0] + more, 0.0), jnp.maximum(levels[axis][1] + more, 0.0))
        return tuple(found)


LAWS: tuple[Effect, ...] = (FrictionAlongTheWay(),)
