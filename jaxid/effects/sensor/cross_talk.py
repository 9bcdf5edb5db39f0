"""A sensor that sees part of another axis: misaligned mounting (data sheets of inertial sensors)."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import shape, signed


def pairs(robot: Robot) -> Iterator[tuple[int, int, str]]:
    """Every output with every other one that it may see: their places and names."""
    names = robot.channels.outputs
    for i, seen in enumerate(names):
        for j, leaking in enumerate(names):
            if i != j:
                yield i, j, f"{seen}_of_{leaking}"


def _alone(robot: Robot) -> str | None:
    several = len(robot.channels.outputs) > 1
    return None if several else f"{robot.name!r} measures one output, which sees no other"


@dataclass(frozen=True)
class SensorCrossTalk(Effect):
    """Every output reads a share of every other one."""

    id: ClassVar[str] = "sensor_cross_talk"
    law: ClassVar[str] = "proportional"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y_i' = y_i + sum over j of share_i_of_j y_j"

    def refusal(self, robot: Robot) -> str | None:
        return _alone(robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        units = robot.channels.units
        for i, j, name in pairs(robot):
            seen, leaking = robot.channels.outputs[i], robot.channels.outputs[j]
            alike = units.get(seen) == units.get(leaking)
            unit = "" if alike else f"{units.get(seen, '')}/({units.get(leaking, '')})"
            found |= signed(
                self, f"share_{name}", unit, 0.03 * robot.scales.output(seen) / robot.scales.output(leaking)
            )
        return found

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        columns = [outputs[:, i] for i in range(outputs.shape[1])]
        for i, j, name in pairs(robot):
            columns[i] = columns[i] + p[self.key(f"share_{name}")] * outputs[:, j]
        return jnp.stack(columns, axis=1)


@dataclass(frozen=True)
class CrossTalkCurves(Curve):
    """What every output reads more with the size of every other one, whichever way that moves: a rectified vibration, or a
    sensor's sensitivity across."""

    id: ClassVar[str] = "sensor_cross_talk"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y_i' = y_i + sum over j of more_i_of_j(|y_j| / amplitude_j)"
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.25, 0.6, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3)
    variable: ClassVar[str] = "share of the other channel's amplitude"

    def refusal(self, robot: Robot) -> str | None:
        return _alone(robot)

    def each(self, robot: Robot) -> tuple[str, ...]:
        return tuple(name for _, _, name in pairs(robot))

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found, units = dict[str, Parameter](), robot.channels.units
        for i, _, name in pairs(robot):
            seen = robot.channels.outputs[i]
            for k in range(len(self.varying)):
                found |= signed(self, f"at_{k + 1}_{name}", units.get(seen, ""), 0.02 * robot.scales.output(seen))
        for name in robot.channels.outputs:
            found |= shape(self, f"amplitude_{name}", units.get(name, ""), robot.scales.output(name), free=False)
        return found | shape(self, "reach", "", 1.0, free=False)

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        columns = [outputs[:, i] for i in range(outputs.shape[1])]
        for i, j, name in pairs(robot):
            share = jnp.abs(outputs[:, j]) / p[self.key(f"amplitude_{robot.channels.outputs[j]}")]
            columns[i] = columns[i] + self.at(share, p, name)
        return jnp.stack(columns, axis=1)


LAWS: tuple[Effect, ...] = (SensorCrossTalk(), CrossTalkCurves())
