"""What is steered follows its command after a pure delay: a bus, a cycle of the servo's controller.

For inputs that do not drive, in another unit than the drive.
"""

from dataclasses import dataclass
from typing import ClassVar

import jax

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.probe import Probe, Seen, one_by_one
from ...robots.robot import Robot
from ..effect_parameters import positive
from .drives import each_other_input, on_drives, other_inputs
from .input_delay import late


@dataclass(frozen=True)
class SteeringDelay(Effect):
    """Every command that does not drive arrives `delay` later."""

    id: ClassVar[str] = "steering_delay"
    law: ClassVar[str] = "constant"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u_i'(t) = u_i(t - delay)"
    only_later: ClassVar[bool] = True
    settles: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("steered",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "delay", "s", 0.1 * robot.scales.time)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("delay"), robot.scales.times_to_try)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return on_drives(robot, late(inputs, time, dt, p[self.key("delay")]), inputs)


@dataclass(frozen=True)
class SteeringDelayOfEach(SteeringDelay):
    """Every input that does not drive with a delay of its own."""

    law: ClassVar[str] = "per_input"
    formula: ClassVar[str] = "u_i'(t) = u_i(t - delay_i)"

    def refusal(self, robot: Robot) -> str | None:
        if len(other_inputs(robot)) > 1:
            return None
        return f"{robot.name!r} has one input that does not drive, of which {self.id} has a law"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in other_inputs(robot):
            found |= positive(self, f"delay_{name}", "s", 0.1 * robot.scales.time)
        return found

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        names = [self.key(f"delay_{name}") for name in other_inputs(robot)]
        return tuple(Probe(dict.fromkeys(names, time)) for time in robot.scales.times_to_try)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        delays = each_other_input(robot, lambda name: p[self.key(f"delay_{name}")])
        each = jax.vmap(late, (2, None, None, 0), 2)(inputs[:, None], time, dt, delays)
        return on_drives(robot, each[:, 0], inputs)


LAWS: tuple[Effect, ...] = (SteeringDelay(), SteeringDelayOfEach())
