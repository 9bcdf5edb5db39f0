"""Measurements stamped late, or early."""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...kernel.places import stamps_before
from ...parameters import Parameter
from ...robots.draw import Draw
from ...robots.effect import Effect, Numbers
from ...robots.probe import Probe, Seen, one_by_one
from ...robots.robot import Robot
from ..earlier import earlier
from ..effect_parameters import positive
from ..scattered import WithinScatter, samples_late
from .lag import averaged
from .outputs import all_late, bends, each_channel, first_slope, sensed, sensed_only


def stamped_late(outputs, time, delay, moving=0.0):
    """`outputs` [T, n] as they were `delay` earlier, exact for speeds that are parabolas between samples; before the first
    stamp as they are there, or, where the log begins in motion (`moving` 1, else 0), on a line."""
    before, share = earlier(time, delay)
    interval, share = (time[before + 1] - time[before])[:, None], share[:, None]
    straight = outputs[before] + share * (outputs[before + 1] - outputs[before])
    early = jnp.minimum(time - delay - time[0], 0.0)[:, None]
    straight = straight + moving * early * first_slope(outputs, time)
    return straight - 0.5 * interval**2 * share * (1.0 - share) * bends(outputs, time)[before]


def stamped_early(outputs, time, lead):
    """`outputs` [T, n] as they will be `lead` later, exact for speeds that are parabolas between samples; past the last sample
    on a straight line for as long as an interval, then held."""
    at = time + lead
    before = jnp.clip(stamps_before(time, at) - 1, 0, len(time) - 2)
    interval = time[before + 1] - time[before]
    share = jnp.minimum((at - time[before]) / interval, 2.0)[:, None]
    straight = outputs[before] + share * (outputs[before + 1] - outputs[before])
    within = jnp.maximum(share * (1.0 - share), 0.0)
    return straight - 0.5 * interval[:, None] ** 2 * within * bends(outputs, time, ahead=True)[before]


@dataclass(frozen=True)
class SensorDelay(Effect):
    """Speeds and positions stamped late: `y'(t) = y(t - delay)`, exact for what is a parabola between samples."""

    id: ClassVar[str] = "sensor_delay"
    law: ClassVar[str] = "constant"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y'(t) = y(t - delay)"
    late: ClassVar[bool] = True
    only_later: ClassVar[bool] = True

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "delay", "s", 0.1 * robot.scales.time)

    def same_on(self, robot: Robot) -> str:
        return "input_delay" if self.law == SensorDelay.law and all_late(robot) else ""

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("delay"), robot.scales.times_to_try)

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        return sensed_only(robot, stamped_late(outputs, time, p[self.key("delay")], moving), outputs)


@dataclass(frozen=True)
class SensorDelayOfEach(SensorDelay):
    """Every channel with a delay of its own."""

    law: ClassVar[str] = "per_channel"
    formula: ClassVar[str] = "y_i'(t) = y_i(t - delay_i)"

    def refusal(self, robot: Robot) -> str | None:
        return (
            None
            if len(robot.channels.outputs) > 1
            else f"{robot.name!r} measures one output, of which {self.id} has a law"
        )

    def in_common(self, robot: Robot) -> str:
        return "input_delay"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in sensed(robot):
            found |= positive(self, f"delay_{name}", "s", 0.1 * robot.scales.time)
        return found

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        names = [self.key(f"delay_{name}") for name in sensed(robot)]
        return tuple(Probe(dict.fromkeys(names, time)) for time in robot.scales.times_to_try)

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        delays = each_channel(self, p, "delay", robot)
        each = jax.vmap(stamped_late, (2, None, 0, None), 2)(outputs[:, None], time, delays, moving)
        return sensed_only(robot, each[:, 0], outputs)


@dataclass(frozen=True)
class JitteringSensorDelay(SensorDelay):
    """Every sample late by a time of its own, anything up to twice the `delay`: on average that is a mean over this time."""

    law: ClassVar[str] = "jittering"
    formula: ClassVar[str] = "y'(t) = mean of y over (t - 2 delay, t)"
    only_later: ClassVar[bool] = False

    def same_on(self, robot: Robot) -> str:
        return "sensor_lag"  # on average

    def delays(self, p: Numbers):
        """The shortest delay and the longest one."""
        return 0.0 * p[self.key("delay")], 2.0 * p[self.key("delay")]

    def draws(self, p: Numbers, robot: Robot) -> tuple[Draw, ...]:
        shortest, longest = (float(delay) for delay in self.delays(p))
        names = sensed(robot)
        late = [i for i, name in enumerate(robot.channels.measured) if name in names]

        def once(outputs, time, random):
            drawn = np.array(outputs)
            drawn[:, late] = samples_late(drawn[:, late], time, (shortest, longest), random)
            return drawn

        return (Draw("outputs", once),)

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        return sensed_only(robot, averaged(outputs, time, 2.0 * p[self.key("delay")], moving=moving), outputs)


@dataclass(frozen=True)
class ScatteredSensorDelay(WithinScatter, JitteringSensorDelay):
    """Every sample late by a time of its own, anything within the `scatter` of the `delay`."""

    law: ClassVar[str] = "scattered"
    formula: ClassVar[str] = "y'(t) = mean of y over (t - delay - scatter, t - delay + scatter)"

    def same_on(self, robot: Robot) -> str:
        return "input_delay" if all_late(robot) else ""  # on average

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        shortest, longest = self.delays(p)
        first = stamped_late(outputs, time, shortest, moving)
        return sensed_only(robot, averaged(first, time, longest - shortest, moving=moving), outputs)


@dataclass(frozen=True)
class GrowingSensorDelay(SensorDelay):
    """Later and later: the sensor's clock runs slow, or what it sent queues up."""

    since_start: ClassVar[bool] = True
    law: ClassVar[str] = "growing"
    formula: ClassVar[str] = "y'(t) = y(t - rate * (t - t_0)), from the log's start t_0"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "rate", "", 1e-3)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("rate"), tuple(2.0 * time / seen.duration for time in robot.scales.times_to_try))

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        later = p[self.key("rate")] * (time - time[0])
        return sensed_only(robot, stamped_late(outputs, time, later, moving), outputs)


@dataclass(frozen=True)
class StampedEarly(SensorDelay):
    """Speeds and positions stamped early, or commands stamped late: rows that hold a command and what came of it."""

    law: ClassVar[str] = "early"
    formula: ClassVar[str] = (
        "y'(t) = y(t + lead), as where commands are logged late, or ramp from row to row (`--intersample linear`)"
    )
    only_later: ClassVar[bool] = False

    def refusal(self, robot: Robot) -> str | None:
        # A lead would take back what a lag's law has too much of, which is no finding about stamps.
        late = next((effect.id for effect in robot.effects if effect.id in _LATE), None)
        return f"{late!r} makes what {robot.name!r} measures late already, which stamps cannot undo" if late else None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "lead", "s", 0.1 * robot.scales.time)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("lead"), robot.scales.times_to_try)

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        return sensed_only(robot, stamped_early(outputs, time, p[self.key("lead")]), outputs)


_LATE = ("sensor_lag", "motor_lag", "input_delay")

LAWS: tuple[Effect, ...] = (
    SensorDelay(),
    SensorDelayOfEach(),
    JitteringSensorDelay(),
    ScatteredSensorDelay(),
    GrowingSensorDelay(),
    StampedEarly(),
)
