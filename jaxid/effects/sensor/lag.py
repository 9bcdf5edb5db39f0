"""Measured speeds behind a low-pass: firmware filters."""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.probe import Probe, Seen, one_by_one
from ...robots.robot import Robot
from ..effect_parameters import positive
from .outputs import bends, outputs_only

_TINY = 1e-9
"""Share of a sample below which a time constant is none."""


def low_passed(outputs, time, T):
    """`outputs` [T, ny] behind a first-order lag of time constant `T` (one, or one a channel), exact for speeds that are
    parabolas between samples."""
    dt = jnp.diff(time)
    slow = jnp.maximum(T, _TINY * jnp.max(dt))
    bent = bends(outputs, time)

    def advance(lagged, row):
        before, now, bend, interval = row
        slope, turn = (now - before) / interval, 0.5 * bend * interval
        # Where the filter runs behind a parabola, at either end.
        first = before - T * (slope - turn) + T * T * bend
        last = now - T * (slope + turn) + T * T * bend
        lagged = last + (lagged - first) * jnp.exp(-interval / slow)
        return lagged, lagged

    _, filtered = jax.lax.scan(advance, outputs[0], (outputs[:-1], outputs[1:], bent, dt))
    return jnp.concatenate([outputs[:1], filtered])


@dataclass(frozen=True)
class SensorLag(Effect):
    """First-order low-pass on the measured speeds, exact for speeds that are parabolas between samples."""

    id: ClassVar[str] = "sensor_lag"
    law: ClassVar[str] = "first_order"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "time_constant * dy'/dt = y - y'"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "time_constant", "s", 0.15 * robot.scales.time)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("time_constant"), robot.scales.times_to_try)

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        return outputs_only(robot, low_passed(outputs, time, p[self.key("time_constant")]), outputs)


LAWS: tuple[Effect, ...] = (SensorLag(),)
