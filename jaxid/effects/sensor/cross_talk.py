"""A sensor that sees part of another axis: misaligned mounting (data sheets of inertial sensors)."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.robot import Robot
from ..effect_parameters import signed


@dataclass(frozen=True)
class SensorCrossTalk(Effect):
    """Every output reads a share of every other one."""

    id: ClassVar[str] = "sensor_cross_talk"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y_i' = y_i + sum over j of share_i_of_j y_j"

    def refusal(self, robot: Robot) -> str | None:
        several = len(robot.channels.outputs) > 1
        return None if several else f"{robot.name!r} measures one output, which sees no other"

    def _pairs(self, robot: Robot) -> Iterator[tuple[int, int, str]]:
        names = robot.channels.outputs
        for i, seen in enumerate(names):
            for j, leaking in enumerate(names):
                if i != j:
                    yield i, j, f"share_{seen}_of_{leaking}"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        units = robot.channels.units
        for i, j, name in self._pairs(robot):
            seen, leaking = robot.channels.outputs[i], robot.channels.outputs[j]
            alike = units.get(seen) == units.get(leaking)
            unit = "" if alike else f"{units.get(seen, '')}/({units.get(leaking, '')})"
            found |= signed(self, name, unit, 0.03 * robot.scales.output(seen) / robot.scales.output(leaking))
        return found

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        columns = [outputs[:, i] for i in range(outputs.shape[1])]
        for i, j, name in self._pairs(robot):
            columns[i] = columns[i] + p[self.key(name)] * outputs[:, j]
        return jnp.stack(columns, axis=1)


LAWS: tuple[Effect, ...] = (SensorCrossTalk(),)
