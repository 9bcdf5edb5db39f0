"""Dry friction of a robot that has been given none (Coulomb; Olsson, Åström, Canudas de Wit, Gäfvert and Lischinsky, European
Journal of Control 4, 1998)."""

from dataclasses import dataclass
from typing import ClassVar

from ...parameters import Parameter
from ...robots.effect import Effect, Levels, Numbers, Scalars, State
from ...robots.robot import Robot
from ..effect_parameters import positive


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
        levers, changed = robot.rim_levers(p), list(levels)
        first = levers[robot.drive_axes[0]]
        for axis, level in zip(robot.drive_axes, self.levels(robot, p), strict=True):
            own = level if levers[axis] is first else level * (levers[axis] / first)
            changed[axis] = (levels[axis][0] + own, levels[axis][1] + own)
        return tuple(changed)


@dataclass(frozen=True)
class CoulombOfEachAxis(CoulombFriction):
    """Every drive axis with a level of its own."""

    law: ClassVar[str] = "per_axis"
    formula: ClassVar[str] = "C_i' = level_i"

    def refusal(self, robot: Robot) -> str | None:
        if len(robot.drive_axes) < 2:
            return f"{robot.name!r} has one drive axis, of which {self.id} has a law"
        return super().refusal(robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for k in range(len(robot.drive_axes)):
            found |= positive(self, f"level_{k + 1}", robot.friction_unit, 0.02 * robot.scales.friction)
        return found

    def levels(self, robot: Robot, p: Numbers) -> Scalars:
        return tuple(p[self.key(f"level_{k + 1}")] for k in range(len(robot.drive_axes)))


LAWS: tuple[Effect, ...] = (CoulombFriction(), CoulombOfEachAxis())
