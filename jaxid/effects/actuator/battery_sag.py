"""The supply drops with what is drawn from it: equivalent circuits of batteries."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import positive, shape, shortest, signed
from ..in_some_logs import InSomeLogs
from .drives import input_unit, on_drives


def nominal_voltage(p: Numbers, robot: Robot) -> Any:
    """The supply's voltage without load [V]."""
    voltage = robot.supply_voltage
    return p[voltage] if isinstance(voltage, str) else voltage


def lowered(volts: Scalars, share: Scalar, robot: Robot) -> Scalars:
    """Motor voltages where the supply has `share` of its nominal voltage: a chopper keeps its duty."""
    return tuple(u * share if k in robot.drive_inputs else u for k, u in enumerate(volts))


def over_motors(of: Callable[[int], Scalar], robot: Robot) -> Scalar:
    """The sum over all motors that drive of what each of input `k` has, `of(k)`."""
    return sum(robot.motors_behind[k] * of(k) for k in robot.drive_inputs)


def motors_of(robot: Robot) -> int:
    """How many motors drive."""
    return sum(robot.motors_behind[k] for k in robot.drive_inputs)


def drawn(volts: Scalars, currents: Scalars, p: Numbers, robot: Robot) -> Scalar:
    """Current [A] that choppers of duty `u / nominal` draw: duty times current, summed."""
    nominal = nominal_voltage(p, robot)
    return over_motors(lambda k: volts[k] / nominal * currents[k], robot)


def behind(r: Scalar, drop: Scalar, volts: Scalars, currents: Scalars, p: Numbers, robot: Robot) -> Scalars:
    """Motor voltages behind a resistance `r` [Ohm], of a supply whose own voltage has fallen by `drop` [V]."""
    nominal = nominal_voltage(p, robot)
    winding = p[robot.winding]
    # The back-EMF pushes back.
    back = over_motors(lambda k: volts[k] / nominal * (volts[k] - winding * currents[k]) / winding, robot)
    stiff = over_motors(lambda k: (volts[k] / nominal) ** 2 / winding, robot)
    return lowered(volts, (nominal - drop + r * back) / (1.0 + r * stiff) / nominal, robot)


def behind_sum(r: Scalar, drop: Scalar, volts: Scalars, currents: Scalars, p: Numbers, robot: Robot) -> Scalars:
    """The same of a supply that falls with the sum of the motors' currents, while none changes its sign by it."""
    total = over_motors(lambda k: jnp.abs(currents[k]), robot)
    back = over_motors(lambda k: jnp.sign(currents[k]) * volts[k], robot) / p[robot.winding]
    return lowered(volts, 1.0 - (drop + r * total) / (nominal_voltage(p, robot) + r * back), robot)


_ROUNDS = 3
"""Times that the drop is worked out anew from the currents that it leaves."""
_TINY = 1e-14
"""Shares of the voltage that are the same but for rounding."""


@dataclass(frozen=True)
class BatterySag(Effect):
    """Supply with inner resistance: the voltages of all motors drop with the total current drawn through their choppers.

    A motor's chopper with duty `u / nominal` draws duty times its current; the supply is `nominal - resistance * total`,
    which is solved for exactly since the currents are linear in it.
    """

    id: ClassVar[str] = "battery_sag"
    law: ClassVar[str] = "duty_times_current"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "supply = nominal - resistance * sum(duty * current)"
    needs: ClassVar[tuple[str, ...]] = ("winding", "supply_voltage")

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        winding = robot.parameters[robot.winding]
        return positive(self, "resistance", winding.unit, 0.15 * winding.value)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        return behind(p[self.key("resistance")], 0.0, volts, currents, p, robot)


@dataclass(frozen=True)
class SagBySum(BatterySag):
    """The supply drops with the sum of the motors' currents, whatever the choppers' duty; solved for exactly while no
    current changes its sign by it."""

    law: ClassVar[str] = "sum_of_currents"
    formula: ClassVar[str] = "supply = nominal - resistance * sum(|current|)"

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        return behind_sum(p[self.key("resistance")], 0.0, volts, currents, p, robot)


@dataclass(frozen=True)
class SagWithRecovery(BatterySag):
    """A supply whose voltage falls and recovers with a time constant: a resistor beside a capacitor, and one before them."""

    since_start: ClassVar[bool] = True
    law: ClassVar[str] = "with_recovery"
    formula: ClassVar[str] = (
        "supply = nominal - resistance_at_once * total - drop, time_constant * d(drop)/dt = resistance * total - drop, "
        "total = sum(duty * current)"
    )

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return (self.own("supply_drop"),)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        winding = robot.parameters[robot.winding]
        at_once = positive(self, "resistance_at_once", winding.unit, 0.15 * winding.value)
        slow = shape(self, "time_constant", "s", 0.1 * robot.scales.duration)
        return super().parameters(robot) | at_once | slow | shortest(self, 2.0 * robot.scales.interval)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        drop = p[self.key("resistance")] * state[self.own("supply_drop")]
        return behind(p[self.key("resistance_at_once")], drop, volts, currents, p, robot)

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        # The state is the current, slowly followed, so that its rate does not hang on the strength.
        power = self._drawn(state, currents, p, robot)
        slow = jnp.maximum(p[self.key("time_constant")], p[self.key("shortest")])
        return {self.own("supply_drop"): (power - state[self.own("supply_drop")]) / slow}

    def _drawn(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> Scalar:
        """The supply's current by the motors' electrical power: i (R i + back-EMF) / nominal."""
        idle = robot.motor((0.0,) * len(currents), state, p)
        winding = p[robot.winding]
        watts = over_motors(lambda k: winding * currents[k] * (currents[k] - idle[k]), robot)
        return watts / nominal_voltage(p, robot)


@dataclass(frozen=True)
class SumWithRecovery(SagWithRecovery):
    """The same of the motors' currents themselves, whatever the choppers' duty."""

    law: ClassVar[str] = "sum_with_recovery"
    formula: ClassVar[str] = (
        "supply = nominal - resistance_at_once * total - drop, time_constant * d(drop)/dt = resistance * total - drop, "
        "total = sum(|current|)"
    )

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        drop = p[self.key("resistance")] * state[self.own("supply_drop")]
        return behind_sum(p[self.key("resistance_at_once")], drop, volts, currents, p, robot)

    def _drawn(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> Scalar:
        return over_motors(lambda k: jnp.abs(currents[k]), robot)


@dataclass(frozen=True)
class Discharge(SagWithRecovery):
    """An open-circuit voltage that falls with the charge taken."""

    law: ClassVar[str] = "discharge"
    formula: ClassVar[str] = "supply = nominal - slope * integral of sum(duty * current)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        winding = robot.parameters[robot.winding].value
        charge = robot.scales.input / winding * robot.scales.duration
        return positive(self, "slope", "V/C", 0.1 * robot.scales.input / charge)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        drop = p[self.key("slope")] * state[self.own("supply_drop")]
        return lowered(volts, 1.0 - drop / nominal_voltage(p, robot), robot)

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        return {self.own("supply_drop"): self._drawn(state, currents, p, robot)}


@dataclass(frozen=True)
class SagOverTime(Effect):
    """What a command makes falls evenly with the time since the start of each log: all that a robot without motor constants
    shows of a battery that runs down, or of a drive that grows weaker."""

    since_start: ClassVar[bool] = True
    id: ClassVar[str] = "battery_sag"
    law: ClassVar[str] = "over_time"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u_i' = u_i (1 - slope * t)"

    def refusal(self, robot: Robot) -> str | None:
        if not (robot.winding and robot.supply_voltage is not None):
            return None
        return f"{robot.name!r} has the constants of its motors and its supply, whose voltage falls with what is drawn from it"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "slope", "1/s", 0.1 / robot.scales.duration)

    @property
    def freer(self) -> Effect | None:
        return SagThatBends(stands_as=self.stands_as)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        left = jnp.maximum(1.0 - p[self.key("slope")] * time, 0.0)
        return on_drives(robot, inputs, inputs * left[:, None])


@dataclass(frozen=True)
class SagThatBends(SagOverTime):
    """The same as a parabola of time: for the question whether the robot's own parameters hang on that it is even."""

    law: ClassVar[str] = "bending"
    restricts: ClassVar[Mapping[str, float]] = MappingProxyType({"bend": 0.0})
    formula: ClassVar[str] = "u_i' = u_i (1 - slope * t - bend * t^2)"

    @property
    def freer(self) -> Effect | None:
        return None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return super().parameters(robot) | signed(self, "bend", "1/s^2", 0.1 / robot.scales.duration**2)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        left = jnp.maximum(1.0 - p[self.key("slope")] * time - p[self.key("bend")] * time**2, 0.0)
        return on_drives(robot, inputs, inputs * left[:, None])


@dataclass(frozen=True)
class SagLevellingOff(SagOverTime):
    """The same, quickly at first and less and less: a battery that settles under load, a drive that warms up."""

    law: ClassVar[str] = "levelling_off"
    formula: ClassVar[str] = "u_i' = u_i (1 - share (1 - exp(-t / time_constant)))"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        slow = shape(self, "time_constant", "s", 0.3 * robot.scales.duration)
        return positive(self, "share", "", 0.05) | slow | shortest(self, 2.0 * robot.scales.interval)

    @property
    def freer(self) -> Effect | None:
        return SagGoingOn(stands_as=self.stands_as)

    def left(self, time, p: Numbers):
        """What is left of a command, as a share of it."""
        slow = jnp.maximum(p[self.key("time_constant")], p[self.key("shortest")])
        return 1.0 + p[self.key("share")] * jnp.expm1(-time / slow)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return on_drives(robot, inputs, inputs * jnp.maximum(self.left(time, p), 0.0)[:, None])


@dataclass(frozen=True)
class SagGoingOn(SagLevellingOff):
    """The same, which goes on evenly: for the question whether the robot's own parameters hang on that it levels off."""

    law: ClassVar[str] = "going_on"
    restricts: ClassVar[Mapping[str, float]] = MappingProxyType({"slope": 0.0})
    formula: ClassVar[str] = "u_i' = u_i (1 - share (1 - exp(-t / time_constant)) - slope * t)"

    @property
    def freer(self) -> Effect | None:
        return None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return super().parameters(robot) | signed(self, "slope", "1/s", 0.1 / robot.scales.duration)

    def left(self, time, p: Numbers):
        return super().left(time, p) - p[self.key("slope")] * time


@dataclass(frozen=True)
class SagByLoad(Effect):
    """What all commands make falls with what the motors draw together, in units of the commands: a supply with inner resistance
    of a robot whose constants of motors and supply are not known."""

    id: ClassVar[str] = "battery_sag"
    law: ClassVar[str] = "by_load"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u_i' = u_i (1 - slope * sum(|u_j' - back-EMF_j|))"
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)

    def refusal(self, robot: Robot) -> str | None:
        return SagOverTime().refusal(robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        every = motors_of(robot) * robot.scales.input
        return positive(self, "slope", f"1/({input_unit(robot)})", 0.05 / every)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        before, share = robot.motor(volts, state, p), 1.0
        for _ in range(_ROUNDS):
            after = robot.motor(lowered(volts, share, robot), state, p)
            now = tuple(i + a - b for i, a, b in zip(currents, after, before, strict=True))
            share = jnp.maximum(1.0 - p[self.key("slope")] * self.drawn(volts, now, robot), 0.0)
        return lowered(volts, share, robot)

    def drawn(self, volts: Scalars, now: Scalars, robot: Robot) -> Scalar:
        """What the motors, whose currents are `now` so large in units of the commands, draw together."""
        return over_motors(lambda k: jnp.abs(now[k]), robot)


@dataclass(frozen=True)
class SagByPower(SagByLoad):
    """The same behind choppers, whose duty times its current a motor draws."""

    law: ClassVar[str] = "by_power"
    formula: ClassVar[str] = "u_i' = u_i (1 - slope * sum(u_j (u_j' - back-EMF_j)))"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        every = motors_of(robot) * robot.scales.input**2
        return positive(self, "slope", f"1/({input_unit(robot)})^2", 0.05 / every)

    def drawn(self, volts: Scalars, now: Scalars, robot: Robot) -> Scalar:
        return jnp.maximum(over_motors(lambda k: volts[k] * now[k], robot), 0.0)


@dataclass(frozen=True)
class OtherBattery(InSomeLogs):
    """A supply that is lower (or higher) by a share throughout the logs whose column `other_battery` is 1."""

    id: ClassVar[str] = "battery_sag"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u_i' = u_i (1 - share) where the log's other_battery is 1"
    from_columns: ClassVar[tuple[str, ...]] = ("other_battery",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "share", "", 0.05)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        return lowered(volts, 1.0 - p[self.key("share")] * self.here(state), robot)


@dataclass(frozen=True)
class SagCurve(Curve):
    """The supply's drop, a curve of the current drawn from it: by the choppers (`by_duty` one), or the motors' sum (zero)."""

    id: ClassVar[str] = "battery_sag"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "supply = nominal - drop(|sum(duty * current)|), or drop(sum(|current|))"
    needs: ClassVar[tuple[str, ...]] = ("winding", "supply_voltage")
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.25, 0.5, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3)
    variable: ClassVar[str] = "current drawn"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        largest = robot.scales.input / robot.parameters[robot.winding].value * motors_of(robot)
        found = self.heights_and_reach(robot, "V", 0.05 * robot.scales.input, "A", largest)
        return found | shape(self, "by_duty", "", 1.0, free=False)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        kinds = ({self.key("by_duty"): share} for share in (1.0, 0.0))
        usual = super().probes(robot, seen)
        return tuple(replace(probe, shape={**probe.shape, **kind}) for kind in kinds for probe in usual)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        nominal, by_duty = nominal_voltage(p, robot), p[self.key("by_duty")]

        def short(share: Scalar) -> Scalar:
            """By how much the supply falls short of a share of its voltage, with what is drawn at that."""
            less = (1.0 - share) / p[robot.winding]
            now = tuple(i - less * u for i, u in zip(currents, volts, strict=True))
            total = over_motors(lambda k: jnp.abs(now[k]), robot)
            total = by_duty * jnp.abs(drawn(volts, now, p, robot)) + (1.0 - by_duty) * total
            return 1.0 - self.at(total, p) / nominal - share

        # What is drawn is less for the drop itself: the full voltage is too much, and what that leaves too little, so that
        # secants between the two settle however steep the drop is.
        before, off = 1.0, short(1.0)
        share = jnp.maximum(before + off, 0.0)
        for _ in range(_ROUNDS):
            now = short(share)
            apart = off - now
            apart = jnp.where(jnp.abs(apart) > _TINY, apart, jnp.inf)
            before, share, off = share, share + now * (share - before) / apart, now
        return lowered(volts, share, robot)


LAWS: tuple[Effect, ...] = (
    BatterySag(),
    SagBySum(),
    SagWithRecovery(),
    SumWithRecovery(),
    Discharge(),
    SagOverTime(),
    SagLevellingOff(),
    SagByLoad(),
    SagByPower(),
    OtherBattery(),
    SagCurve(),
)
