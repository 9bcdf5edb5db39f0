"""What is steered is not what was commanded: a trim that is off, a linkage of another ratio or of none that is constant.

For inputs that do not drive: a steering angle, a brake, in another unit than the drive.
"""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import shape, signed
from .drives import each_other_input, other_inputs


@dataclass(frozen=True)
class SteeringOffset(Effect):
    """A constant offset on every command that does not drive."""

    id: ClassVar[str] = "steering_error"
    law: ClassVar[str] = "offset"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u_i' = u_i + offset_i"
    memoryless: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("steered",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in other_inputs(robot):
            unit = robot.channels.units.get(name, "")
            found |= signed(self, f"offset_{name}", unit, 0.05 * robot.scales.input_of(name))
        return found

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return inputs + each_other_input(robot, lambda name: p[self.key(f"offset_{name}")])


@dataclass(frozen=True)
class SteeringGain(SteeringOffset):
    """Another ratio than nominal."""

    law: ClassVar[str] = "gain"
    formula: ClassVar[str] = "u_i' = (1 + gain_i) u_i"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in other_inputs(robot):
            found |= signed(self, f"gain_{name}", "", 0.05)
        return found

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return inputs * (1.0 + each_other_input(robot, lambda name: p[self.key(f"gain_{name}")]))


@dataclass(frozen=True)
class SteeringGainBySide(SteeringOffset):
    """Another ratio than nominal, one for either direction."""

    law: ClassVar[str] = "gain_by_side"
    formula: ClassVar[str] = "u_i' = (1 + gain_plus_i) u_i where u_i > 0, (1 + gain_minus_i) u_i elsewhere"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in other_inputs(robot):
            found |= signed(self, f"gain_plus_{name}", "", 0.05) | signed(self, f"gain_minus_{name}", "", 0.05)
        return found

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        plus, minus = (each_other_input(robot, lambda n, s=side: p[self.key(f"gain_{s}_{n}")]) for side in _SIDES)
        return inputs * (1.0 + jnp.where(inputs > 0, plus, minus))


_SIDES = "plus", "minus"


@dataclass(frozen=True)
class SteeringCurves(Curve):
    """What is added to every command, a curve of it from its largest value to the one side to that to the other."""

    id: ClassVar[str] = "steering_error"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u_i' = u_i + error_i((1 + u_i / amplitude_i) / 2)"
    memoryless: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("steered",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.25, 0.5, 0.75, 1.0)
    free: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 4)
    variable: ClassVar[str] = "share of the way from the command farthest to the one side to that to the other"

    def each(self, robot: Robot) -> tuple[str, ...]:
        return tuple(other_inputs(robot))

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in self.each(robot):
            unit, size = robot.channels.units.get(name, ""), robot.scales.input_of(name)
            for k in range(len(self.varying)):
                found |= signed(self, f"at_{k + 1}_{name}", unit, 0.05 * size)
            found |= shape(self, f"amplitude_{name}", unit, size, free=False)
        return found | shape(self, "reach", "", 1.0, free=False)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        columns = [inputs[:, k] for k in range(inputs.shape[1])]
        for k, name in enumerate(robot.channels.inputs):
            if name in self.each(robot):
                place = 0.5 * (1.0 + columns[k] / p[self.key(f"amplitude_{name}")])
                columns[k] = columns[k] + self.at(place, p, name)
        return jnp.stack(columns, axis=1)


LAWS: tuple[Effect, ...] = (SteeringOffset(), SteeringGain(), SteeringGainBySide(), SteeringCurves())
