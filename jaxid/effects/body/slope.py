"""A tilted floor."""

from dataclasses import dataclass, replace
from typing import ClassVar

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ..effect_parameters import signed
from ..line import beyond_line, line_parameters, lines_across

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


@dataclass(frozen=True)
class TwoPlanes(GroundSlope):
    """A floor of two planes that meet in a line: beyond it (`across_a_line`) the slope is another."""

    edge: float = 1.0

    law: ClassVar[str] = "two_planes"
    formula: ClassVar[str] = "F_world = mass g (slope + change where x cos(angle) + y sin(angle) > offset)"

    @property
    def blurred(self) -> "TwoPlanes":
        return replace(self, edge=4.0)

    @property
    def sharp(self) -> "TwoPlanes":
        return replace(self, edge=1.0)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.03 * robot.scales.acceleration / GRAVITY
        changes = signed(self, "change_x", "rad", typical) | signed(self, "change_y", "rad", typical)
        return super().parameters(robot) | changes | line_parameters(self, robot)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        strengths = {
            self.key(name): robot.parameters[self.key(name)].typical or 1.0
            for name in ("slope_x", "slope_y", "change_x", "change_y")
        }
        lines = lines_across(self, seen, (0.3, 0.5, 0.7), half=True)
        return tuple(Probe(strengths, line, out_of=len(lines)) for line in lines)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        beyond = beyond_line(self, state, p, self.edge)
        along = [p[self.key(f"slope_{a}")] + p[self.key(f"change_{a}")] * beyond for a in "xy"]
        added = robot.field_force((GRAVITY * along[0], GRAVITY * along[1]), state, p)
        return tuple(f + extra for f, extra in zip(forces, added, strict=True))


LAWS: tuple[Effect, ...] = (GroundSlope(), CurvedFloor(), TwoPlanes())
