"""What is steered follows its command late: servos and linkages (first order; the rate limit of a data sheet).

For inputs that do not drive, in another unit than the drive.
"""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.probe import Probe, Seen, one_by_one
from ...robots.robot import Robot
from ..effect_parameters import positive
from .drives import on_drives, other_inputs
from .followed import as_a_servo, low_passed, ramped


@dataclass(frozen=True)
class SteeringLag(Effect):
    """First-order lag of every command that does not drive, its exact mean over every integration step."""

    id: ClassVar[str] = "steering_lag"
    law: ClassVar[str] = "first_order"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "time_constant * du'/dt = u - u'"
    finer: ClassVar[float] = 2.0
    settles: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("steered",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "time_constant", "s", 0.15 * robot.scales.time)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("time_constant"), robot.scales.times_to_try)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return on_drives(robot, low_passed(inputs, dt, p[self.key("time_constant")]), inputs)


@dataclass(frozen=True)
class SteeringRamp(SteeringLag):
    """A servo's largest rate: one unit takes `time_per_unit` at least, one for every input that does not drive."""

    law: ClassVar[str] = "ramp"
    formula: ClassVar[str] = "|du_i'/dt| <= 1 / time_per_unit_i"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in other_inputs(robot):
            unit = f"s/{robot.channels.units.get(name, '') or '1'}"
            found |= positive(
                self, f"time_per_unit_{name}", unit, 0.15 * robot.scales.time / robot.scales.input_of(name)
            )
        return found

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return tuple(
            Probe(
                {self.key(f"time_per_unit_{name}"): time / robot.scales.input_of(name) for name in other_inputs(robot)}
            )
            for time in robot.scales.times_to_try
        )

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return on_drives(robot, ramped(inputs, dt, self._per_unit(p, robot)), inputs)

    def _per_unit(self, p: Numbers, robot: Robot):
        """The time [nu] that each input takes for one unit at least; none where it drives."""
        names = other_inputs(robot)
        times = [p[self.key(f"time_per_unit_{n}")] if n in names else 0.0 for n in robot.channels.inputs]
        return jnp.stack([jnp.asarray(time, float) for time in times])


@dataclass(frozen=True)
class SteeringServo(SteeringRamp):
    """A position loop whose motor has a largest speed."""

    law: ClassVar[str] = "servo"
    formula: ClassVar[str] = "time_constant * du'/dt = u - u', |du_i'/dt| <= 1 / time_per_unit_i"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        lag = SteeringLag(stands_as=self.stands_as).parameters(robot)
        return lag | SteeringRamp(stands_as=self.stands_as).parameters(robot)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        # No slope leads away from a time of zero: each ramp is asked at times that a lag may have.
        time, ramps = self.key("time_constant"), super().probes(robot, seen)
        return tuple(Probe(ramp.strengths, {time: T}) for T in robot.scales.times_to_try for ramp in ramps)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        T = p[self.key("time_constant")]
        return on_drives(robot, as_a_servo(inputs, dt, T, self._per_unit(p, robot)), inputs)


LAWS: tuple[Effect, ...] = (SteeringLag(), SteeringRamp(), SteeringServo())
