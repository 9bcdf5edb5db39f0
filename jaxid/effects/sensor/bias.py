"""An offset of a sensor, constant or drifting (data sheets of inertial sensors)."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import shape, signed
from .outputs import each_channel


@dataclass(frozen=True)
class SensorBias(Effect):
    """A constant offset on every measured speed."""

    id: ClassVar[str] = "sensor_bias"
    law: ClassVar[str] = "constant"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y' = y + bias"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in robot.channels.outputs:
            found |= signed(self, f"bias_{name}", robot.channels.units.get(name, ""), 0.02 * robot.scales.output(name))
        return found

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        return outputs + each_channel(self, p, "bias", robot)


@dataclass(frozen=True)
class DriftingBias(SensorBias):
    """An offset that drifts with the time since the start of each log."""

    since_start: ClassVar[bool] = True
    law: ClassVar[str] = "drifting"
    formula: ClassVar[str] = "y' = y + bias + drift * t"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found = super().parameters(robot)
        for name in robot.channels.outputs:
            unit, size = robot.channels.units.get(name, ""), 0.02 * robot.scales.output(name)
            found |= signed(self, f"drift_{name}", f"{unit}/s", size / robot.scales.duration)
        return found

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        drift = each_channel(self, p, "drift", robot)
        return super().measure(outputs, time, p, robot) + time[:, None] * drift[None, :]


@dataclass(frozen=True)
class BiasCurves(Curve):
    """Every output's offset, a curve of the time since the start of each log: warming up."""

    since_start: ClassVar[bool] = True
    id: ClassVar[str] = "sensor_bias"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y_i' = y_i + bias_i(t)"
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.15, 0.4, 0.7, 1.0)
    free: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 4)
    variable: ClassVar[str] = "time"
    wanders: ClassVar[bool] = True

    def each(self, robot: Robot) -> tuple[str, ...]:
        return robot.channels.outputs

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in self.each(robot):
            unit, typical = robot.channels.units.get(name, ""), 0.02 * robot.scales.output(name)
            for k in range(len(self.varying)):
                found |= signed(self, f"at_{k + 1}_{name}", unit, typical)
        return found | shape(self, "reach", "s", robot.scales.duration, free=False)

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        columns = [outputs[:, i] for i in range(outputs.shape[1])]
        for i, name in enumerate(self.each(robot)):
            columns[i] = columns[i] + self.at(time, p, name)
        return jnp.stack(columns, axis=1)


LAWS: tuple[Effect, ...] = (SensorBias(), DriftingBias(), BiasCurves())
