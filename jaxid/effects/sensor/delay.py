"""Measurements stamped late."""

from dataclasses import dataclass
from typing import ClassVar

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.probe import Probe, Seen, one_by_one
from ...robots.robot import Robot
from ..earlier import earlier
from ..effect_parameters import positive
from .outputs import bends, outputs_only


@dataclass(frozen=True)
class SensorDelay(Effect):
    """Speeds stamped late: `y'(t) = y(t - delay)`, exact for speeds that are parabolas between samples."""

    id: ClassVar[str] = "sensor_delay"
    law: ClassVar[str] = "constant"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y'(t) = y(t - delay)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "delay", "s", 0.1 * robot.scales.time)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("delay"), robot.scales.times_to_try)

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        before, share = earlier(time, p[self.key("delay")])
        interval, share = (time[before + 1] - time[before])[:, None], share[:, None]
        straight = outputs[before] + share * (outputs[before + 1] - outputs[before])
        sag = 0.5 * interval**2 * share * (1.0 - share) * bends(outputs, time)[before]
        return outputs_only(robot, straight - sag, outputs)


LAWS: tuple[Effect, ...] = (SensorDelay(),)
