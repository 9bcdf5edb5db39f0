"""An offset of a sensor, constant or drifting (data sheets of inertial sensors)."""

from dataclasses import dataclass
from typing import ClassVar

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.robot import Robot
from ..effect_parameters import signed
from .outputs import each_output


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
        return outputs + each_output(self, p, "bias", robot)


@dataclass(frozen=True)
class DriftingBias(SensorBias):
    """An offset that drifts with the time since the start of each log."""

    law: ClassVar[str] = "drifting"
    formula: ClassVar[str] = "y' = y + bias + drift * t"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found = super().parameters(robot)
        for name in robot.channels.outputs:
            unit, size = robot.channels.units.get(name, ""), 0.02 * robot.scales.output(name)
            found |= signed(self, f"drift_{name}", f"{unit}/s", size / robot.scales.duration)
        return found

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        drift = each_output(self, p, "drift", robot)
        return super().measure(outputs, time, p, robot) + time[:, None] * drift[None, :]


LAWS: tuple[Effect, ...] = (SensorBias(), DriftingBias())
