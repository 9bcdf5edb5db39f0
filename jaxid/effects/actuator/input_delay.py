"""Pure transport delay between the logged command and the torque."""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.draw import Draw
from ...robots.effect import Effect, Numbers
from ...robots.probe import Probe, Seen, one_by_one
from ...robots.robot import Robot
from ..earlier import earlier
from ..effect_parameters import positive
from ..scattered import WithinScatter, changes_late, rows_late
from ..sensor.outputs import all_late
from .drives import drive_names, each_drive, on_drives, other_inputs

_LEAST = 1e-6
"""Share of a step that is always shown."""


def late(inputs, time, dt, delay):
    """The mean of `inputs` [T, n], held over steps `dt`, `delay` seconds later (one, or one at every edge of the steps,
    [T + 1]), over every step; nothing acts before the first."""
    # Differences of its integral, which is linear between stamps.
    edges = jnp.concatenate([time, time[-1:] + dt[-1:]])
    # From the end of the first step on, which may stand for all that came before a log: sums of it would be rounded.
    steps = inputs * dt[:, None]
    whole = jnp.concatenate([-steps[:1], jnp.zeros_like(steps[:1]), jnp.cumsum(steps[1:], axis=0)])
    before, share = earlier(edges, delay)
    then = whole[before] + share[:, None] * (whole[before + 1] - whole[before])
    # A delay that grows within a step shows less of the past than the step is long: a command that is held stays as large.
    shown = dt - jnp.diff(jnp.broadcast_to(delay, edges.shape))
    return jnp.diff(then, axis=0) / jnp.maximum(shown, _LEAST * dt)[:, None]


_PARTS = 8
"""Delays that stand for all between none and twice their mean."""


@dataclass(frozen=True)
class InputDelay(Effect):
    """`u'(t) = u(t - delay)`: pure transport delay between logged command and torque."""

    id: ClassVar[str] = "input_delay"
    law: ClassVar[str] = "constant"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u'(t) = u(t - delay)"
    late: ClassVar[bool] = True
    settles: ClassVar[bool] = True
    only_later: ClassVar[bool] = True

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "delay", "s", 0.1 * robot.scales.time)

    def same_on(self, robot: Robot) -> str:
        return "sensor_delay" if self.law == InputDelay.law and all_late(robot) else ""

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("delay"), robot.scales.times_to_try)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return on_drives(robot, inputs, late(inputs, time, dt, p[self.key("delay")]))


@dataclass(frozen=True)
class DelayOfEach(InputDelay):
    """Every drive input with a delay of its own."""

    law: ClassVar[str] = "per_input"
    formula: ClassVar[str] = "u_i'(t) = u_i(t - delay_i)"
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)

    def in_common(self, robot: Robot) -> str:
        return "" if other_inputs(robot) else "sensor_delay"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in drive_names(robot):
            found |= positive(self, f"delay_{name}", "s", 0.1 * robot.scales.time)
        return found

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        names = [self.key(f"delay_{name}") for name in drive_names(robot)]
        return tuple(Probe(dict.fromkeys(names, time)) for time in robot.scales.times_to_try)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        delays = each_drive(robot, lambda name: p[self.key(f"delay_{name}")])
        each = jax.vmap(late, (2, None, None, 0), 2)(inputs[:, None], time, dt, delays)
        return on_drives(robot, inputs, each[:, 0])


@dataclass(frozen=True)
class DelayOfAll(InputDelay):
    """Every input with the same delay, those that steer with those that drive: one bus, one radio link."""

    law: ClassVar[str] = "every_input"
    formula: ClassVar[str] = "u_i'(t) = u_i(t - delay), of inputs that do not drive, too"
    needs: ClassVar[tuple[str, ...]] = ("steered",)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return late(inputs, time, dt, p[self.key("delay")])


@dataclass(frozen=True)
class JitteringDelay(InputDelay):
    """Every command late by a time of its own, anything up to twice the `delay`: on average that is a mean over this time."""

    law: ClassVar[str] = "jittering"
    formula: ClassVar[str] = "u'(t) = mean of u over (t - 2 delay, t)"
    only_later: ClassVar[bool] = False

    def same_on(self, robot: Robot) -> str:
        return "motor_lag"  # on average

    def delays(self, p: Numbers):
        """The shortest delay and the longest one."""
        return 0.0 * p[self.key("delay")], 2.0 * p[self.key("delay")]

    def draws(self, p: Numbers, robot: Robot) -> tuple[Draw, ...]:
        shortest, longest = (float(delay) for delay in self.delays(p))
        drives = list(robot.drive_inputs)

        def of(late_by_chance):
            def once(inputs, time, random):
                drawn, edges = np.array(inputs), np.append(time, 2.0 * time[-1] - time[-2])
                drawn[:, drives] = late_by_chance(drawn[:, drives], edges, (shortest, longest), random)
                return drawn

            return Draw("inputs", once)

        return of(changes_late), of(rows_late)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        shortest, longest = self.delays(p)
        delays = shortest + (jnp.arange(_PARTS) + 0.5) / _PARTS * (longest - shortest)
        parts = jax.vmap(late, (None, None, None, 0))(inputs, time, dt, delays)
        return on_drives(robot, inputs, jnp.mean(parts, axis=0))


@dataclass(frozen=True)
class ScatteredDelay(WithinScatter, JitteringDelay):
    """Every command late by a time of its own, anything within the `scatter` of the `delay`: a queue or a radio link behind a
    fixed time of transport."""

    law: ClassVar[str] = "scattered"
    formula: ClassVar[str] = "u'(t) = mean of u over (t - delay - scatter, t - delay + scatter)"

    def same_on(self, robot: Robot) -> str:
        return "sensor_delay" if all_late(robot) else ""  # on average


@dataclass(frozen=True)
class GrowingDelay(InputDelay):
    """Later and later: commands queue up, or two clocks run apart."""

    since_start: ClassVar[bool] = True
    settles: ClassVar[bool] = False
    law: ClassVar[str] = "growing"
    formula: ClassVar[str] = "u'(t) = u(t - rate * (t - t_0)), from the log's start t_0"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "rate", "", 1e-3)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("rate"), tuple(2.0 * time / seen.duration for time in robot.scales.times_to_try))

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        edges = jnp.concatenate([time, time[-1:] + dt[-1:]])
        return on_drives(robot, inputs, late(inputs, time, dt, p[self.key("rate")] * (edges - time[0])))


LAWS: tuple[Effect, ...] = (
    InputDelay(),
    DelayOfEach(),
    DelayOfAll(),
    JitteringDelay(),
    ScatteredDelay(),
    GrowingDelay(),
)
