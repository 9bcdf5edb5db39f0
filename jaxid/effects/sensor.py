"""Effects between the motion and what the log says of it."""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp

from ..parameters import Parameter
from ..robots.effect import Effect, Numbers
from ..robots.robot import Robot
from .actuator import earlier
from .effect_parameters import positive, signed

_TINY = 1e-9


@dataclass(frozen=True)
class _OnOutputs(Effect):
    """An effect on the measured outputs; optional channels (currents, position) keep out of it."""

    def _each(self, p: Numbers, stem: str, robot: Robot):
        names = robot.channels.outputs
        absent = len(robot.channels.measured) - len(names)
        values = [jnp.asarray(p[self.key(f"{stem}_{name}")], float) for name in names]
        return jnp.stack([*values, *([jnp.zeros(())] * absent)])


def outputs_only(robot: Robot, changed, outputs):
    """`changed` for the outputs, `outputs` for the optional channels, both [T, ny]."""
    n = len(robot.channels.outputs)
    return jnp.concatenate([changed[:, :n], outputs[:, n:]], axis=1)


@dataclass(frozen=True)
class SensorBias(_OnOutputs):
    """A constant offset on every measured speed."""

    id: ClassVar[str] = "sensor_bias"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y' = y + bias"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in robot.channels.outputs:
            found |= signed(self, f"bias_{name}", robot.channels.units.get(name, ""), 0.02 * robot.scales.output(name))
        return found

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        return outputs + self._each(p, "bias", robot)


@dataclass(frozen=True)
class SensorScale(_OnOutputs):
    """A wrong scale on every measured speed."""

    id: ClassVar[str] = "sensor_scale"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y' = (1 + error) y"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in robot.channels.outputs:
            found |= signed(self, f"error_{name}", "", 0.03)
        return found

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        return outputs * (1.0 + self._each(p, "error", robot))


def _bends(y, time):
    """Second derivative of y [T, ny] within each interval [T - 1, ny]: the smaller of those at its two ends.

    Inputs change at samples and put kinks there; those belong to no interval.
    """
    slope = jnp.diff(y, axis=0) / jnp.diff(time)[:, None]
    inner = jnp.diff(slope, axis=0) / (0.5 * (time[2:] - time[:-2]))[:, None]
    left = jnp.concatenate([jnp.zeros_like(slope[:1]), inner])
    right = jnp.concatenate([inner, jnp.zeros_like(slope[:1])])
    smaller = jnp.where(jnp.abs(left) < jnp.abs(right), left, right)
    return jnp.where(left * right > 0.0, smaller, 0.0)


@dataclass(frozen=True)
class SensorLag(_OnOutputs):
    """First-order low-pass on the measured speeds, exact for speeds that are parabolas between samples."""

    id: ClassVar[str] = "sensor_lag"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "time_constant * dy'/dt = y - y'"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "time_constant", "s", 0.15 * robot.scales.time)

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        T = p[self.key("time_constant")]
        dt = jnp.diff(time)
        decay = jnp.exp(-dt / jnp.maximum(T, _TINY * dt))
        bends = _bends(outputs, time)

        def advance(lagged, row):
            before, now, bend, keep, interval = row
            slope, turn = (now - before) / interval, 0.5 * bend * interval
            # Where the filter runs behind a parabola, at either end.
            first = before - T * (slope - turn) + T * T * bend
            last = now - T * (slope + turn) + T * T * bend
            lagged = last + (lagged - first) * keep
            return lagged, lagged

        _, filtered = jax.lax.scan(advance, outputs[0], (outputs[:-1], outputs[1:], bends, decay, dt))
        return outputs_only(robot, jnp.concatenate([outputs[:1], filtered]), outputs)


@dataclass(frozen=True)
class SensorDelay(_OnOutputs):
    """Speeds stamped late: `y'(t) = y(t - delay)`, exact for speeds that are parabolas between samples."""

    id: ClassVar[str] = "sensor_delay"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y'(t) = y(t - delay)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "delay", "s", 0.1 * robot.scales.time)

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        before, share = earlier(time, p[self.key("delay")])
        interval, share = (time[before + 1] - time[before])[:, None], share[:, None]
        straight = outputs[before] + share * (outputs[before + 1] - outputs[before])
        sag = 0.5 * interval**2 * share * (1.0 - share) * _bends(outputs, time)[before]
        return outputs_only(robot, straight - sag, outputs)
