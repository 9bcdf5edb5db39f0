"""Dry friction of a robot that has been given none (Coulomb; Olsson, Åström, Canudas de Wit, Gäfvert and Lischinsky, European
Journal of Control 4, 1998)."""

from dataclasses import dataclass
from typing import ClassVar

from ...parameters import Parameter
from ...robots.effect import Effect, Levels, Numbers, Scalars, State
from ...robots.robot import Robot
from ..effect_parameters import PER_AXIS, axis_names, positive
from .by_axis import at_rims, has_one_axis, on_drive_axes


def rubs(robot: Robot) -> bool:
    """Whether any axis has dry friction of its own, or would have with other values of the free parameters."""
    numbers = dict(robot.parameters.numbers)
    numbers |= {name: numbers[name] + (robot.parameters[name].typical or 1.0) for name in robot.parameters.free_names}
    zero = dict.fromkeys(robot.states, 0.0) | robot.initial_state()
    return any(float(level) != 0.0 for pair in robot.own_coulomb(zero, numbers) for level in pair)


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """Dry friction of all drive axes of a robot without: the same force at every wheel's rim, whatever the speed."""

    id: ClassVar[str] = "coulomb_friction"
    law: ClassVar[str] = "all_axes"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = level"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)

    def refusal(self, robot: Robot) -> str | None:
        return f"{robot.name!r} has dry friction of its own, whose level is a parameter" if rubs(robot) else None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "level", robot.friction_unit, 0.02 * robot.scales.friction)

    def levels(self, robot: Robot, p: Numbers) -> Scalars:
        """One for each drive axis, at the rim."""
        return (p[self.key("level")],) * len(robot.drive_axes)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        own = at_rims(robot, p, self.levels(robot, p))
        return on_drive_axes(robot, levels, own, lambda level, more: (level[0] + more, level[1] + more))


@dataclass(frozen=True)
class CoulombOfEachAxis(CoulombFriction):
    """Every drive axis with a level of its own."""

    law: ClassVar[str] = PER_AXIS
    formula: ClassVar[str] = "C_i' = level_i"

    def refusal(self, robot: Robot) -> str | None:
        return has_one_axis(self, robot) or super().refusal(robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in axis_names(robot):
            found |= positive(self, f"level_{name}", robot.friction_unit, 0.02 * robot.scales.friction)
        return found

    def levels(self, robot: Robot, p: Numbers) -> Scalars:
        return tuple(p[self.key(f"level_{name}")] for name in axis_names(robot))


LAWS: tuple[Effect, ...] = (CoulombFriction(), CoulombOfEachAxis())
