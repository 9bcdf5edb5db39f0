"""A wrong scale of a sensor."""

from dataclasses import dataclass
from typing import ClassVar

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.robot import Robot
from ..effect_parameters import signed
from .outputs import each_output


@dataclass(frozen=True)
class SensorScale(Effect):
    """A wrong scale on every measured speed."""

    id: ClassVar[str] = "sensor_scale"
    law: ClassVar[str] = "each_channel"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y' = (1 + error) y"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in robot.channels.outputs:
            found |= signed(self, f"error_{name}", "", 0.03)
        return found

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        return outputs * (1.0 + each_output(self, p, "error", robot))


LAWS: tuple[Effect, ...] = (SensorScale(),)
