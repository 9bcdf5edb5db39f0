"""Measurements behind a low-pass: firmware filters."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...kernel.recurrence import recurrence
from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.probe import Probe, Seen, one_by_one
from ...robots.robot import Robot
from ..earlier import earlier
from ..effect_parameters import exchanged, positive
from .outputs import bends, each_channel, first_slope, sensed, sensed_only

_TINY = 1e-9
"""Share of a sample below which a time constant is none."""


def low_passed(outputs, time, T, moving=0.0):
    """`outputs` [T, ny] behind a first-order lag of time constant `T` (one, or one a channel), exact for speeds that are
    parabolas between samples. Where the log begins in motion (`moving` 1, else 0) the filter runs behind a line."""
    dt = jnp.diff(time)[:, None]
    before, now = outputs[:-1], outputs[1:]
    bent = bends(outputs, time)
    slope, turn, bend = (now - before) / dt, 0.5 * bent * dt, T * T * bent
    keep = jnp.exp(-dt / jnp.maximum(T, _TINY * jnp.max(dt)))
    # Where the filter runs behind a parabola, at either end.
    first = before - T * (slope - turn) + bend
    last = now - T * (slope + turn) + bend
    begun = outputs[0] - moving * T * first_slope(outputs, time)
    filtered = recurrence(keep, last - first * keep, begun)
    return jnp.concatenate([begun[None], filtered])


def damped(outputs, time, asked, damping, moving=0.0):
    """`outputs` [T, ny] behind a low-pass of second order of mean delay `asked` (one, or one a channel) and `damping` < 1,
    exact for speeds that are parabolas between samples; `moving` as `low_passed` has it.

    One of its two poles z = -decay + i turn tells all: y' is the imaginary part of x with dx/dt = z x + y, times |z|^2 / turn.
    Seen from axes that turn with it, x runs through a recurrence that is real.
    """
    dt = jnp.diff(time)[:, None]
    mean = jnp.maximum(asked, 0.2 * jnp.max(dt))  # of a shorter one, a share of what this changes
    decay, turn = 2.0 * damping**2 / mean, 2.0 * damping * jnp.sqrt(1.0 - damping**2) / mean
    size = decay**2 + turn**2

    def over_pole(real, imaginary):
        return (-decay * real + turn * imaginary) / size, (-decay * imaginary - turn * real) / size

    def turned(real, imaginary, angle):
        cos, sin = jnp.cos(angle), jnp.sin(angle)
        return real * cos - imaginary * sin, real * sin + imaginary * cos

    bent = bends(outputs, time)
    slope = jnp.diff(outputs, axis=0) / dt - 0.5 * bent * dt
    square = over_pole(-0.5 * bent, 0.0)
    line = over_pole(2.0 * square[0] - slope, 2.0 * square[1])
    level = over_pole(line[0] - outputs[:-1], line[1])  # where x runs behind a parabola, at the start of each interval
    keep = jnp.exp(-decay * dt)
    left = turned(level[0], level[1], turn * dt)
    real, imaginary = (c + dt * (b + dt * a) - keep * d for a, b, c, d in zip(square, line, level, left, strict=True))
    along = turn * (time - time[0])[:, None]
    fixed = turned(real, imaginary, -along[1:])
    line = over_pole(-moving * first_slope(outputs, time), 0.0)
    held = over_pole(line[0] - outputs[0], line[1])
    real, imaginary = (recurrence(keep, part, first) for part, first in zip(fixed, held, strict=True))
    late = jnp.concatenate([held[1][None], turned(real, imaginary, along[1:])[1]]) * size / turn
    return outputs + asked / mean * (late - outputs)


def averaged(outputs, time, asked, ahead=0.0, moving=0.0):
    """The mean of `outputs` [T, ny], parabolas between samples, over `asked` seconds, of which the share `ahead` is still to
    come; what is before the first stamp and after the last is as it is there; before the first it is on a line where `moving`
    is 1."""
    dt = jnp.diff(time)[:, None]
    window = jnp.maximum(asked, 0.1 * jnp.max(dt))  # of a shorter one, a share of what this changes
    bent = bends(outputs, time, ahead > 0.0)
    whole = jnp.cumsum(0.5 * dt * (outputs[1:] + outputs[:-1]) - dt**3 / 12.0 * bent, axis=0)
    whole = jnp.concatenate([jnp.zeros_like(outputs[:1]), whole])

    def until(then):
        """The integral of the outputs up to other times."""
        before, share = earlier(time, time - jnp.minimum(then, time[-1]))
        step, share = dt[before], share[:, None]
        start, slope = outputs[before], (outputs[before + 1] - outputs[before])
        turn = step**2 * (0.25 - share / 6.0) * bent[before]
        found = whole[before] + step * (share * start + share**2 * (0.5 * slope - turn))
        early, late = jnp.minimum(then - time[0], 0.0), jnp.maximum(then - time[-1], 0.0)
        begun = early[:, None] * outputs[0] + moving * 0.5 * early[:, None] ** 2 * first_slope(outputs, time)
        return found + begun + late[:, None] * outputs[-1]

    end = until(time + ahead * window) if ahead else whole
    return outputs + asked / window * ((end - until(time - (1.0 - ahead) * window)) / window - outputs)


@dataclass(frozen=True)
class SensorLag(Effect):
    """First-order low-pass on measured speeds and positions, exact for what is a parabola between samples."""

    id: ClassVar[str] = "sensor_lag"
    law: ClassVar[str] = "first_order"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "time_constant * dy'/dt = y - y'"
    late: ClassVar[bool] = True

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "time_constant", "s", 0.15 * robot.scales.time)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("time_constant"), robot.scales.times_to_try)

    def elsewhere(self, robot: Robot) -> dict[str, float]:
        name = self.key("time_constant")
        return exchanged(robot, name) if name in robot.parameters else {}

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        return sensed_only(robot, low_passed(outputs, time, p[self.key("time_constant")], moving), outputs)


@dataclass(frozen=True)
class SecondOrderSensorLag(SensorLag):
    """Two first-order lags one after the other, with half the time constant each."""

    law: ClassVar[str] = "second_order"
    formula: ClassVar[str] = "two lags of time_constant / 2, one after the other"

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        half = 0.5 * p[self.key("time_constant")]
        once = low_passed(outputs, time, half, moving)
        return sensed_only(robot, low_passed(once, time, half, moving), outputs)


@dataclass(frozen=True)
class SensorLagOfEach(SensorLag):
    """A first-order lag of every channel's own."""

    law: ClassVar[str] = "per_channel"
    formula: ClassVar[str] = "time_constant_i * dy_i'/dt = y_i - y_i'"
    stem: ClassVar[str] = "time_constant"
    """What a channel's own parameter is called."""
    typical: ClassVar[float] = 0.15
    """Its usual size in time constants of the robot."""
    times: ClassVar[float] = 1.0
    """Its size for a lag as long as a time to try."""

    def refusal(self, robot: Robot) -> str | None:
        return (
            None
            if len(robot.channels.outputs) > 1
            else f"{robot.name!r} measures one output, of which {self.id} has laws"
        )

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in sensed(robot):
            found |= positive(self, f"{self.stem}_{name}", "s", self.typical * robot.scales.time)
        return found

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        names = [self.key(f"{self.stem}_{name}") for name in sensed(robot)]
        return tuple(Probe(dict.fromkeys(names, self.times * time)) for time in robot.scales.times_to_try)

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        each = each_channel(self, p, "time_constant", robot)
        return sensed_only(robot, low_passed(outputs, time, each, moving), outputs)


_BUTTERWORTH = 0.7071067811865476
"""Damping of the flattest passband (Butterworth, Experimental Wireless 7, 1930), as gyros' and amplifiers' filters have it."""


class _AnyDamping(Effect):
    """A low-pass of second order whose damping is estimated."""

    first_look: ClassVar[bool] = False

    @property
    def denser(self) -> Effect | None:
        return None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        free = Parameter(_BUTTERWORTH, "", free=True, lower=0.2, upper=0.995, typical=0.3, source="catalogue")
        return super().parameters(robot) | {self.key("damping"): free}

    def damping(self, p: Numbers):
        return p[self.key("damping")]


@dataclass(frozen=True)
class Butterworth(SensorLag):
    """A Butterworth low-pass of second order: a filter set by its corner frequency, 1 / (pi sqrt(2) time_constant)."""

    law: ClassVar[str] = "butterworth"
    formula: ClassVar[str] = "d2y'/dt2 = w^2 (y - y') - sqrt(2) w dy'/dt, w = sqrt(2) / time_constant"

    @property
    def denser(self) -> Effect | None:
        return DampedLag(stands_as=self.stands_as)

    def damping(self, p: Numbers):
        return _BUTTERWORTH

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        own = p[self.key("time_constant")]
        return sensed_only(robot, damped(outputs, time, own, self.damping(p), moving), outputs)


@dataclass(frozen=True)
class DampedLag(_AnyDamping, Butterworth):
    """A low-pass of second order of any damping: looked for where the flattest one leaves something."""

    law: ClassVar[str] = "damped"
    formula: ClassVar[str] = "d2y'/dt2 = w^2 (y - y') - 2 damping w dy'/dt, w = 2 damping / time_constant"


@dataclass(frozen=True)
class ButterworthOfEach(SensorLagOfEach):
    """A Butterworth low-pass of every channel's own: a gyro's, say, and none of the wheels'."""

    law: ClassVar[str] = "butterworth_per_channel"
    formula: ClassVar[str] = "d2y_i'/dt2 = w_i^2 (y_i - y_i') - sqrt(2) w_i dy_i'/dt, w_i = sqrt(2) / time_constant_i"

    @property
    def denser(self) -> Effect | None:
        return DampedLagOfEach(stands_as=self.stands_as)

    def damping(self, p: Numbers):
        return _BUTTERWORTH

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        each = each_channel(self, p, "time_constant", robot)
        return sensed_only(robot, damped(outputs, time, each, self.damping(p), moving), outputs)


@dataclass(frozen=True)
class DampedLagOfEach(_AnyDamping, ButterworthOfEach):
    """A low-pass of second order of every channel's own, all of one damping."""

    law: ClassVar[str] = "damped_per_channel"
    formula: ClassVar[str] = (
        "d2y_i'/dt2 = w_i^2 (y_i - y_i') - 2 damping w_i dy_i'/dt, w_i = 2 damping / time_constant_i"
    )


@dataclass(frozen=True)
class MovingAverage(SensorLag):
    """The mean of what is measured over the last `window`: counters read over a time, firmware filters."""

    law: ClassVar[str] = "moving_average"
    formula: ClassVar[str] = "y'(t) = mean of y over (t - window, t)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "window", "s", 0.3 * robot.scales.time)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("window"), tuple(2.0 * time for time in robot.scales.times_to_try))

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        return sensed_only(robot, averaged(outputs, time, p[self.key("window")], self.ahead, moving), outputs)


@dataclass(frozen=True)
class CentredAverage(MovingAverage):
    """The mean about the stamp: positions differentiated by central differences, logs smoothed afterwards."""

    law: ClassVar[str] = "centred_average"
    formula: ClassVar[str] = "y'(t) = mean of y over (t - window / 2, t + window / 2)"
    ahead: ClassVar[float] = 0.5

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("window"), tuple(4.0 * time for time in robot.scales.times_to_try))


@dataclass(frozen=True)
class MovingAverageOfEach(SensorLagOfEach):
    """The mean of what is measured over the last window of every channel's own: counters' beside a gyro that has none."""

    law: ClassVar[str] = "moving_average_per_channel"
    formula: ClassVar[str] = "y_i'(t) = mean of y_i over (t - window_i, t)"
    stem: ClassVar[str] = "window"
    typical: ClassVar[float] = 0.3
    times: ClassVar[float] = 2.0

    def measure(self, outputs, time, p: Numbers, robot: Robot, moving=0.0):
        windows = each_channel(self, p, self.stem, robot)
        each = [averaged(outputs[:, i : i + 1], time, windows[i], self.ahead, moving) for i in range(outputs.shape[1])]
        return sensed_only(robot, jnp.concatenate(each, axis=1), outputs)


@dataclass(frozen=True)
class CentredAverageOfEach(MovingAverageOfEach):
    """The mean about the stamp over a window of every channel's own."""

    law: ClassVar[str] = "centred_average_per_channel"
    formula: ClassVar[str] = "y_i'(t) = mean of y_i over (t - window_i / 2, t + window_i / 2)"
    ahead: ClassVar[float] = 0.5
    times: ClassVar[float] = 4.0


LAWS: tuple[Effect, ...] = (
    SensorLag(),
    SecondOrderSensorLag(),
    SensorLagOfEach(),
    Butterworth(),
    DampedLag(),
    ButterworthOfEach(),
    DampedLagOfEach(),
    MovingAverage(),
    CentredAverage(),
    MovingAverageOfEach(),
    CentredAverageOfEach(),
)
