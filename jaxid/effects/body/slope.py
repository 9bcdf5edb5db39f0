"""A tilted floor."""

from dataclasses import dataclass, replace
from typing import ClassVar

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ...robots.trigonometry import sincos
from ..curve import curve
from ..effect_parameters import shape, signed
from ..line import beyond_line, line_parameters, lines_across

GRAVITY = 9.81
"""Standard acceleration of free fall, rounded [m/s²]."""
_PULLED = (
    "a hose, a cable or a spring that pulls by the place: the height of a floor would be seen with a level, and such a pull is "
    "gone once it is taken off"
)
_PLACES = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Where the heights of a profile stand, in units of its reach on either side of the line."""


def gravity(robot: Robot) -> float:
    """The acceleration of free fall in the robot's unit of length."""
    return GRAVITY * robot.metre


@dataclass(frozen=True)
class GroundSlope(Effect):
    """Tilted floor: gravity `g (slope_x, slope_y)` along the world's x and y, pulling at every body's mass."""

    id: ClassVar[str] = "ground_slope"
    law: ClassVar[str] = "plane"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "F_world = mass g (slope_x, slope_y)"
    needs: ClassVar[tuple[str, ...]] = ("pose", "weight")

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.03 * robot.scales.acceleration / gravity(robot)
        return signed(self, "slope_x", "rad", typical) | signed(self, "slope_y", "rad", typical)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        g = gravity(robot)
        field = (g * p[self.key("slope_x")], g * p[self.key("slope_y")])
        added = robot.field_force(field, state, p)
        return tuple(f + extra for f, extra in zip(forces, added, strict=True))


@dataclass(frozen=True)
class CurvedFloor(GroundSlope):
    """A slope that changes with the place, as on a bowl, a ridge or a ramp: the gradient of a quadratic height."""

    law: ClassVar[str] = "curved"
    same_as: ClassVar[str] = _PULLED
    formula: ClassVar[str] = "slope_x' = slope_x + bend_xx x + bend_xy y, slope_y' = slope_y + bend_xy x + bend_yy y"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found = super().parameters(robot)
        typical = 0.03 * robot.scales.acceleration / gravity(robot) / robot.scales.length
        for name in ("bend_xx", "bend_xy", "bend_yy"):
            found |= signed(self, name, f"rad/{robot.length_unit}", typical)
        return found

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        x, y = state["x"], state["y"]
        along_x = p[self.key("slope_x")] + p[self.key("bend_xx")] * x + p[self.key("bend_xy")] * y
        along_y = p[self.key("slope_y")] + p[self.key("bend_xy")] * x + p[self.key("bend_yy")] * y
        g = gravity(robot)
        added = robot.field_force((g * along_x, g * along_y), state, p)
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

    @property
    def denser(self) -> Effect | None:
        return Profile(self.edge, stands_as=self.stands_as)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.03 * robot.scales.acceleration / gravity(robot)
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
        g = gravity(robot)
        added = robot.field_force((g * along[0], g * along[1]), state, p)
        return tuple(f + extra for f, extra in zip(forces, added, strict=True))


@dataclass(frozen=True)
class Profile(TwoPlanes):
    """Any slope along one direction: two planes and a smooth change besides, looked for where the planes leave something."""

    law: ClassVar[str] = "profile"
    same_as: ClassVar[str] = _PULLED
    formula: ClassVar[str] = "slope' = two planes + a curve of x cos(angle) + y sin(angle) - offset, zero at the line"
    first_look: ClassVar[bool] = False

    @property
    def denser(self) -> Effect | None:
        return None

    def _heights(self, axis: str) -> list[str | None]:
        """Names of the heights of one component at all places; none at the line."""
        return [self.key(f"at_{k}_{axis}") if place else None for k, place in enumerate(_PLACES)]

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found, typical = super().parameters(robot), 0.03 * robot.scales.acceleration / gravity(robot)
        for axis in "xy":
            for k, place in enumerate(_PLACES):
                found |= signed(self, f"at_{k}_{axis}", "rad", typical) if place else {}
        return found | shape(self, "reach", robot.length_unit, robot.scales.length, free=False)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        sine, cosine = sincos(p[self.key("angle")])
        way = state["x"] * cosine + state["y"] * sine - p[self.key("offset")]
        field = []
        for axis in "xy":
            heights = [0.0 if name is None else p[name] for name in self._heights(axis)]
            field.append(gravity(robot) * curve(way, _PLACES, heights, p[self.key("reach")]))
        added = robot.field_force((field[0], field[1]), state, p)
        before = super().force(forces, state, p, robot)
        return tuple(f + extra for f, extra in zip(before, added, strict=True))


@dataclass(frozen=True)
class AlongALine(Effect):
    """What goes along a line alone is pulled along it by the same force everywhere."""

    id: ClassVar[str] = "ground_slope"
    law: ClassVar[str] = "along_a_line"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = (
        "F = force: the line is not level, a current carries it, or the force command has an offset"
    )
    needs: ClassVar[tuple[str, ...]] = ("translation",)

    def refusal(self, robot: Robot) -> str | None:
        if robot.in_plane or robot.turns:
            return f"{robot.name!r} does not go along a line alone"
        if not robot.velocities:
            return f"{robot.name!r} does not say at which of its velocities a force would act"
        if _pulled_already(robot):
            return f"a parameter of {robot.name!r} itself that is free is such a force"
        return None

    def _names(self, robot: Robot) -> dict[str, str]:
        """Velocity -> the name of the force on it: more than one where parts move against each other, as behind a belt."""
        several = len(robot.velocities) > 1
        return {velocity: f"force_{velocity}" if several else "force" for velocity in robot.velocities}

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for velocity, name in self._names(robot).items():
            found |= signed(self, name, robot.force_unit(velocity), 0.03 * robot.scales.force)
        return found

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        return tuple(f + p[self.key(name)] for f, name in zip(forces, self._names(robot).values(), strict=True))


def _pulled_already(robot: Robot) -> bool:
    """Whether a free parameter of the robot's own moves it from rest without a command."""
    table, rest = robot.parameters, dict.fromkeys(robot.states, 0.0) | robot.initial_state()
    none, still = (0.0,) * len(robot.channels.inputs), (0.0,) * len(robot.rubbing(rest, table.numbers))

    def pull(numbers: Numbers) -> float:
        return float(robot.rates(rest, none, still, numbers)[robot.velocities[0]])

    others = (
        {**table.numbers, name: table[name].value + (abs(table[name].value) or table[name].typical or 1.0)}
        for name in table.free_names
    )
    return any(pull(numbers) != pull(table.numbers) for numbers in others)


LAWS: tuple[Effect, ...] = (GroundSlope(), CurvedFloor(), TwoPlanes(), Profile(), AlongALine())
