"""A motor that gets part of another one's command: drivers, mixers or wires that leak (multivariable plants with cross-coupled
inputs; Skogestad and Postlethwaite, Multivariable Feedback Control, 2005)."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import signed
from .drives import input_unit


def pairs(robot: Robot) -> Iterator[tuple[int, int, str]]:
    """Every drive input with every other one of which its motor may get part: their places and names."""
    names = robot.channels.inputs
    for i in robot.drive_inputs:
        for j in robot.drive_inputs:
            if i != j:
                yield i, j, f"{names[i]}_of_{names[j]}"


@dataclass(frozen=True)
class MotorCrossTalk(Effect):
    """Every motor gets a share of every other one's command."""

    id: ClassVar[str] = "motor_cross_talk"
    law: ClassVar[str] = "proportional"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u_i' = u_i + sum over j of share_i_of_j u_j"
    memoryless: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for _, _, name in pairs(robot):
            found |= signed(self, f"share_{name}", "", 0.05)
        return found

    def may_hold(self, robot: Robot) -> list[str]:
        """Of many shares all but the largest, the smallest first: several together are a change of the robot's own constants,
        and most motors leak nothing."""
        names = [self.key(f"share_{name}") for _, _, name in pairs(robot)]
        sizes = {name: abs(robot.parameters[name].value) for name in names if robot.parameters[name].free}
        return sorted(sizes, key=lambda name: sizes[name])[:-1] if len(sizes) > 2 else []

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        columns = [inputs[:, i] for i in range(inputs.shape[1])]
        for i, j, name in pairs(robot):
            columns[i] = columns[i] + p[self.key(f"share_{name}")] * inputs[:, j]
        return jnp.stack(columns, axis=1)


@dataclass(frozen=True)
class LeakCurve(Curve):
    """What every motor gets of the others' commands, as a share of them, a curve of the size of the command that leaks."""

    id: ClassVar[str] = "motor_cross_talk"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u_i' = u_i + sum over the other j of share(|u_j|) u_j"
    memoryless: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)
    knots: ClassVar[tuple[float, ...]] = (0.1, 0.4, 0.9)
    free: ClassVar[tuple[int, ...]] = (0, 1, 2)
    variable: ClassVar[str] = "|u|"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return self.heights_and_reach(robot, "", 0.05, input_unit(robot), robot.scales.input)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        columns = [inputs[:, i] for i in range(inputs.shape[1])]
        for i, j, _ in pairs(robot):
            columns[i] = columns[i] + self.at(jnp.abs(inputs[:, j]), p) * inputs[:, j]
        return jnp.stack(columns, axis=1)


LAWS: tuple[Effect, ...] = (MotorCrossTalk(), LeakCurve())
