"""A tilted floor."""

from dataclasses import dataclass
from typing import ClassVar

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.robot import Robot
from ..effect_parameters import signed

GRAVITY = 9.81
"""Standard acceleration of free fall, rounded [m/s²]."""


@dataclass(frozen=True)
class GroundSlope(Effect):
    """Tilted floor: gravity `g (slope_x, slope_y)` along the world's x and y, pulling at every body's mass."""

    id: ClassVar[str] = "ground_slope"
    law: ClassVar[str] = "plane"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "F_world = mass g (slope_x, slope_y)"
    needs: ClassVar[tuple[str, ...]] = ("pose", "weight")

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.03 * robot.scales.acceleration / GRAVITY
        return signed(self, "slope_x", "rad", typical) | signed(self, "slope_y", "rad", typical)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        field = (GRAVITY * p[self.key("slope_x")], GRAVITY * p[self.key("slope_y")])
        added = robot.field_force(field, state, p)
        return tuple(f + extra for f, extra in zip(forces, added, strict=True))


@dataclass(frozen=True)
class CurvedFloor(GroundSlope):
    """A slope that changes with the place, as on a bowl, a ridge or a ramp: the gradient of a quadratic height."""

    law: ClassVar[str] = "curved"
    formula: ClassVar[str] = "slope_x' = slope_x + bend_xx x + bend_xy y, slope_y' = slope_y + bend_xy x + bend_yy y"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found = super().parameters(robot)
        typical = 0.03 * robot.scales.acceleration / GRAVITY / robot.scales.length
        for name in ("bend_xx", "bend_xy", "bend_yy"):
            found |= signed(self, name, "rad/m", typical)
        return found

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        x, y = state["x"], state["y"]
        along_x = p[self.key("slope_x")] + p[self.key("bend_xx")] * x + p[self.key("bend_xy")] * y
        along_y = p[self.key("slope_y")] + p[self.key("bend_xy")] * x + p[self.key("bend_yy")] * y
        added = robot.field_force((GRAVITY * along_x, GRAVITY * along_y), state, p)
        return tuple(f + extra for f, extra in zip(forces, added, strict=True))


LAWS: tuple[Effect, ...] = (GroundSlope(), CurvedFloor())
