"""The torque follows its command late and smoothly: driver filters, winding inductance, inner loops."""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.probe import Probe, Seen, one_by_one
from ...robots.robot import Robot
from ..curve import SHAPE
from ..effect_parameters import exchanged, positive, shape, shortest, signed
from .drives import (
    back_emf,
    drive_names,
    each_drive,
    input_unit,
    on_drives,
    one_torque_each,
    torque_falls_with_speed,
)
from .followed import as_a_servo, lagged_unequally, low_passed, ramped
from .input_delay import late

_STABLE = 0.5
"""Share of a sampling interval that a step of Runge and Kutta of order four over the whole of it follows; 0.36 is the least."""


_UNEQUAL = 3.0
"""Ratio of two time constants that are tried as unequal."""
_NEXT_TO_NONE = 0.05
"""Share of a response that is as good as none of it."""


@dataclass(frozen=True)
class MotorLag(Effect):
    """First-order lag between command and torque: `T du'/dt = u - u'`, its exact mean over every integration step."""

    id: ClassVar[str] = "motor_lag"
    law: ClassVar[str] = "first_order"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "time_constant * du'/dt = u - u'"
    late: ClassVar[bool] = True
    settles: ClassVar[bool] = True
    finer: ClassVar[float] = 2.0

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "time_constant", "s", 0.15 * robot.scales.time)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("time_constant"), robot.scales.times_to_try)

    def elsewhere(self, robot: Robot) -> dict[str, float]:
        name = self.key("time_constant")
        return exchanged(robot, name) if name in robot.parameters else {}

    @property
    def denser(self) -> Effect | None:
        return RampAndLag(stands_as=self.stands_as) if self.law in (MotorLag.law, SlewRate.law) else None

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return on_drives(robot, inputs, low_passed(inputs, dt, p[self.key("time_constant")]))


@dataclass(frozen=True)
class LagOfAll(MotorLag):
    """The same lag of every input, those that steer with those that drive: a filter of all commands."""

    law: ClassVar[str] = "every_input"
    formula: ClassVar[str] = "time_constant * du_i'/dt = u_i - u_i', of inputs that do not drive, too"
    needs: ClassVar[tuple[str, ...]] = ("steered",)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return low_passed(inputs, dt, p[self.key("time_constant")])


@dataclass(frozen=True)
class SecondOrderLag(MotorLag):
    """Two first-order lags one after the other, with half the time constant each."""

    law: ClassVar[str] = "second_order"
    formula: ClassVar[str] = "two lags of time_constant / 2, one after the other"

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        half = 0.5 * p[self.key("time_constant")]
        return on_drives(robot, inputs, low_passed(low_passed(inputs, dt, half), dt, half))


@dataclass(frozen=True)
class Inductance(MotorLag):
    """A lag of the winding's current (time constant L / R), so that the back-EMF acts late as well.

    The current of command less back-EMF, both behind one lag, is the difference of the two behind it.
    """

    law: ClassVar[str] = "inductance"
    formula: ClassVar[str] = "time_constant * di/dt = (u - back-EMF) / R - i"
    needs: ClassVar[tuple[str, ...]] = ("winding",)

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return tuple(self.own(f"late_emf_{robot.channels.inputs[k]}") for k in robot.drive_inputs)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        # Below it the late back-EMF fades into the present one; it must follow that, too, in one step a sample.
        return super().parameters(robot) | shortest(self, _STABLE * robot.scales.interval)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        T, changed = p[self.key("time_constant")], list(volts)
        share = T / jnp.maximum(T, p[self.key("shortest")])
        for name, k in zip(self.states_on(robot), robot.drive_inputs, strict=True):
            changed[k] = volts[k] + share * (back_emf(volts, currents, k, p, robot) - state[name])
        return tuple(changed)

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        T = jnp.maximum(p[self.key("time_constant")], p[self.key("shortest")])
        idle = robot.motor((0.0,) * len(currents), state, p)  # the currents that the back-EMF alone would drive
        named = zip(self.states_on(robot), robot.drive_inputs, strict=True)
        return {name: (-p[robot.winding] * idle[k] - state[name]) / T for name, k in named}


@dataclass(frozen=True)
class InductanceOfTorques(MotorLag):
    """The same on a robot of which no winding is known, only torques that fall with the speed: what they are without a command
    is what the back-EMF takes, and comes late."""

    law: ClassVar[str] = "late_torque"
    formula: ClassVar[str] = "time_constant * dt_i'/dt = t_i(u_i, speed) - t_i', of the whole torque, back-EMF included"

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return tuple(self.own(f"late_emf_{name}") for name in drive_names(robot))

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return super().parameters(robot) | shortest(self, _STABLE * robot.scales.interval)

    def refusal(self, robot: Robot) -> str | None:
        if robot.winding:
            return f"the windings of {robot.name!r} are known, so that {self.title} acts on their currents"
        if not (one_torque_each(robot) and torque_falls_with_speed(robot)):
            return (
                f"the drive torques of {robot.name!r} do not fall with its speed, one for every drive input, so that "
                f"{self.title} is a lag of the command"
            )
        return None

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        T = p[self.key("time_constant")]
        share = T / jnp.maximum(T, p[self.key("shortest")])
        braking = _without_command(robot, state, p)
        late = (state[name] for name in self.states_on(robot))
        return tuple(t + share * (before - now) for t, now, before in zip(torques, braking, late, strict=True))

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        T = jnp.maximum(p[self.key("time_constant")], p[self.key("shortest")])
        braking = zip(self.states_on(robot), _without_command(robot, state, p), strict=True)
        return {name: (now - state[name]) / T for name, now in braking}


def _without_command(robot: Robot, state: State, p: Numbers) -> Scalars:
    """The drive torques without a command, by the back-EMF alone."""
    return robot.drive_torques((0.0,) * len(robot.channels.inputs), state, p)


@dataclass(frozen=True)
class LagOfEach(MotorLag):
    """A first-order lag of every motor's own."""

    law: ClassVar[str] = "per_motor"
    formula: ClassVar[str] = "time_constant_i * du_i'/dt = u_i - u_i'"
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in drive_names(robot):
            found |= positive(self, f"time_constant_{name}", "s", 0.15 * robot.scales.time)
        return found

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        names = [self.key(f"time_constant_{name}") for name in drive_names(robot)]
        return tuple(Probe(dict.fromkeys(names, time)) for time in robot.scales.times_to_try)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        T = each_drive(robot, lambda name: p[self.key(f"time_constant_{name}")])
        return on_drives(robot, inputs, low_passed(inputs, dt, T))


@dataclass(frozen=True)
class UnequalLags(MotorLag):
    """A driver that lets go at another pace than it pulls, as one whose current decays by itself."""

    law: ClassVar[str] = "unequal_lags"
    formula: ClassVar[str] = (
        "T du'/dt = u - u', T = time_constant where |u'| grows, ratio_back * time_constant where it shrinks"
    )

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        ratio = Parameter(1.0, "", free=True, lower=0.0, typical=1.0, source="catalogue")
        return super().parameters(robot) | {self.key("ratio_back"): ratio}

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        time, ratio = self.key("time_constant"), self.key("ratio_back")
        times = robot.scales.times_to_try
        return tuple(Probe({time: T}, shape={ratio: by}) for T in times for by in (1.0 / _UNEQUAL, _UNEQUAL))

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        T = p[self.key("time_constant")]
        return on_drives(robot, inputs, lagged_unequally(inputs, dt, T, p[self.key("ratio_back")] * T))


@dataclass(frozen=True)
class SlewRate(MotorLag):
    """A driver's ramp: the voltage changes by one unit in `time_per_unit` at most."""

    law: ClassVar[str] = "ramp"
    formula: ClassVar[str] = "|du'/dt| <= 1 / time_per_unit"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit = f"s/{input_unit(robot)}"
        return positive(self, "time_per_unit", unit, 0.15 * robot.scales.time / robot.scales.input)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        times = tuple(time / robot.scales.input for time in robot.scales.ramps_to_try)
        return one_by_one(self.key("time_per_unit"), times)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return on_drives(robot, inputs, ramped(inputs, dt, p[self.key("time_per_unit")]))


@dataclass(frozen=True)
class RampAndLag(SlewRate):
    """A lag behind a ramp, as of a driver whose current is limited: looked for where one of the two leaves something."""

    law: ClassVar[str] = "ramp_and_lag"
    first_look: ClassVar[bool] = False
    formula: ClassVar[str] = "time_constant * du'/dt = r - u', r follows u with |dr/dt| <= 1 / time_per_unit"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        ramp = SlewRate(stands_as=self.stands_as).parameters(robot)
        return ramp | MotorLag(stands_as=self.stands_as).parameters(robot)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        ramp = ramped(inputs, dt, p[self.key("time_per_unit")])
        return on_drives(robot, inputs, low_passed(ramp, dt, p[self.key("time_constant")]))


@dataclass(frozen=True)
class LimitedLag(RampAndLag):
    """A loop, such as of a speed, that closes what is left within a time, and no faster than its ramp lets it."""

    law: ClassVar[str] = "lag_with_limit"
    formula: ClassVar[str] = "time_constant * du'/dt = u - u', |du'/dt| <= 1 / time_per_unit"

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        T, per_unit = p[self.key("time_constant")], p[self.key("time_per_unit")]
        return on_drives(robot, inputs, as_a_servo(inputs, dt, T, per_unit))


@dataclass(frozen=True)
class UnequalRamps(SlewRate):
    """A driver's ramp that slows down faster than it speeds up.

    The other way round a command of two levels would be followed as after a delay.
    """

    law: ClassVar[str] = "unequal_ramps"
    formula: ClassVar[str] = (
        "d|u'|/dt <= 1 / time_per_unit, -d|u'|/dt <= 1 / (share_back * time_per_unit), share_back <= 1"
    )

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        share = Parameter(0.5, "", free=True, lower=0.0, upper=1.0, typical=0.5, source="catalogue")
        return super().parameters(robot) | {self.key("share_back"): share}

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        away = p[self.key("time_per_unit")]
        return on_drives(robot, inputs, ramped(inputs, dt, away, p[self.key("share_back")] * away))


@dataclass(frozen=True)
class RampOfEach(MotorLag):
    """A ramp of every drive input's own: the limits of speed and yaw rate that a base with velocity commands has."""

    law: ClassVar[str] = "ramp_per_motor"
    formula: ClassVar[str] = "|du_i'/dt| <= 1 / time_per_unit_i"
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in drive_names(robot):
            unit, size = robot.channels.units.get(name, ""), robot.scales.input_of(name)
            found |= positive(self, f"time_per_unit_{name}", f"s/{unit}", 0.15 * robot.scales.time / size)
        return found

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        names = {self.key(f"time_per_unit_{name}"): robot.scales.input_of(name) for name in drive_names(robot)}
        return tuple(Probe({key: time / size for key, size in names.items()}) for time in robot.scales.ramps_to_try)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        per_unit = each_drive(robot, lambda name: p[self.key(f"time_per_unit_{name}")])
        return on_drives(robot, inputs, ramped(inputs, dt, per_unit))


@dataclass(frozen=True)
class RampOfBody(MotorLag):
    """Ramps of a body's speed and yaw rate, from which a controller makes the commands of two sides afterwards."""

    law: ClassVar[str] = "ramp_of_body"
    formula: ClassVar[str] = (
        "|d(u_1 + u_2)'/dt| <= 2 / time_per_unit_mean, |d(u_1 - u_2)'/dt| <= 2 / time_per_unit_difference"
    )

    def refusal(self, robot: Robot) -> str | None:
        count = len(robot.drive_inputs)
        return (
            None if count == 2 else f"the robot {robot.name!r} has {count} drive input(s), and {self.law!r} is of two"
        )

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, size = f"s/{input_unit(robot)}", 0.15 * robot.scales.time / robot.scales.input
        return positive(self, "time_per_unit_mean", unit, size) | positive(self, "time_per_unit_difference", unit, size)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        names = self.key("time_per_unit_mean"), self.key("time_per_unit_difference")
        return tuple(Probe(dict.fromkeys(names, time / robot.scales.input)) for time in robot.scales.ramps_to_try)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        one, other = robot.drive_inputs
        sides = jnp.stack([inputs[:, one] + inputs[:, other], inputs[:, one] - inputs[:, other]], axis=-1) / 2.0
        per_unit = jnp.stack([p[self.key("time_per_unit_mean")], p[self.key("time_per_unit_difference")]])
        mean, half = ramped(sides, dt, per_unit).T
        return inputs.at[:, one].set(mean + half).at[:, other].set(mean - half)


@dataclass(frozen=True)
class StepResponse(Effect):
    """Any response to a step of the command: shares of it that come late by multiples of the fixed `spacing`."""

    id: ClassVar[str] = "motor_lag"
    law: ClassVar[str] = SHAPE
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u'(t) = u(t) + sum over k of share_k (u(t - k spacing) - u(t)), k = 1, 2, 4"
    finer: ClassVar[float] = 2.0
    settles: ClassVar[bool] = True
    rather: ClassVar[str] = "input_delay"
    multiples: ClassVar[tuple[int, ...]] = (1, 2, 4)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for k in self.multiples:
            found |= signed(self, f"share_{k}", "", 0.1)
        return found | shape(self, "spacing", "s", robot.scales.times_to_try[1], free=False)

    def doubt(self, robot: Robot) -> str:
        """A response that comes before the command on average is none that a motor has."""
        p = robot.parameters.numbers
        mean = p[self.key("spacing")] * sum(k * p[self.key(f"share_{k}")] for k in self.multiples)
        return f"by its shares what acts comes {-mean:.2g} s before the command that was logged" if mean < 0.0 else ""

    def same_on(self, robot: Robot) -> str:
        """All of a command that comes by two neighbouring delays at most is one that is late by a time between these."""
        p = robot.parameters.numbers
        shares = [p[self.key(f"share_{k}")] for k in self.multiples]
        each = [1.0 - sum(shares), *shares]
        pairs = (each[:k] + each[k + 2 :] for k in range(len(each) - 1))
        return "input_delay" if any(max(map(abs, others)) < _NEXT_TO_NONE for others in pairs) else ""

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        shares = jnp.stack([jnp.asarray(p[self.key(f"share_{k}")], float) for k in self.multiples])
        delays = jnp.array(self.multiples) * p[self.key("spacing")]
        parts = jax.vmap(late, (None, None, None, 0))(inputs, time, dt, delays) - inputs
        return on_drives(robot, inputs, inputs + jnp.tensordot(shares, parts, 1))


LAWS: tuple[Effect, ...] = (
    MotorLag(),
    SecondOrderLag(),
    Inductance(),
    InductanceOfTorques(),
    LagOfEach(),
    LagOfAll(),
    UnequalLags(),
    SlewRate(),
    RampAndLag(),
    LimitedLag(),
    UnequalRamps(),
    RampOfEach(),
    RampOfBody(),
    StepResponse(),
)
