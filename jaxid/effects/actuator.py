"""Effects between the commanded voltage and the motor's torque."""

from dataclasses import dataclass
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from ..parameters import Parameter
from ..robots.effect import Effect, Numbers, Scalars, State
from ..robots.robot import Robot
from .effect_parameters import positive, signed

_TINY = 1e-9
"""Share of a step below which a time constant is none."""


def input_unit(robot: Robot) -> str:
    """Unit of the drive inputs."""
    return robot.channels.units.get(robot.channels.inputs[0], "")


def on_drives(robot: Robot, inputs, changed):
    """`changed` where an input drives, `inputs` elsewhere, both [T, nu]."""
    count = len(robot.channels.inputs)
    drives = jnp.array([i in robot.drive_inputs for i in range(count)])
    return changed if len(robot.drive_inputs) == count else jnp.where(drives, changed, inputs)


@dataclass(frozen=True)
class DeadZone(Effect):
    """`u' = u - clip(u, -threshold, threshold)`: voltage below the threshold does nothing, above it the threshold is lost."""

    id: ClassVar[str] = "actuator_dead_zone"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u' = u - clip(u, -threshold, threshold)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "threshold", input_unit(robot), 0.03 * robot.scales.input)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        threshold = p[self.key("threshold")]
        return on_drives(robot, inputs, inputs - jnp.clip(inputs, -threshold, threshold))


@dataclass(frozen=True)
class VoltageSaturation(Effect):
    """`u' = clip(u, -limit, limit)` with `inverse_limit = 1 / limit`, zero for no limit."""

    id: ClassVar[str] = "voltage_saturation"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u' = clip(u, -limit, limit), limit = 1 / inverse_limit"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "inverse_limit", f"1/{input_unit(robot)}", 1.0 / robot.scales.input)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        limited = inputs / jnp.maximum(1.0, jnp.abs(inputs) * p[self.key("inverse_limit")])
        return on_drives(robot, inputs, limited)


@dataclass(frozen=True)
class BatterySag(Effect):
    """Supply with inner resistance: the voltages of all motors drop with the total current drawn through their choppers.

    A motor's chopper with duty `u / nominal` draws duty times its current; the supply is `nominal - resistance * total`,
    which is solved for exactly since the currents are linear in it.
    """

    id: ClassVar[str] = "battery_sag"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "supply = nominal - resistance * sum(duty * current)"
    needs: ClassVar[tuple[str, ...]] = ("winding", "supply_voltage")

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        winding = robot.parameters[robot.winding]
        return positive(self, "resistance", winding.unit, 0.15 * winding.value)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        voltage = robot.supply_voltage
        nominal: Any = p[voltage] if isinstance(voltage, str) else voltage
        r, winding, above, below = p[self.key("resistance")], p[robot.winding], nominal, 1.0
        for k in robot.drive_inputs:
            u, i = volts[k], currents[k]
            duty = u / nominal
            above = above + r * duty * (u - winding * i) / winding  # the back-EMF pushes back
            below = below + r * duty * duty / winding
        share = above / below / nominal
        return tuple(u * share if k in robot.drive_inputs else u for k, u in enumerate(volts))


@dataclass(frozen=True)
class MotorLag(Effect):
    """First-order lag between command and torque: `T du'/dt = u - u'`, its exact mean over every integration step."""

    id: ClassVar[str] = "motor_lag"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "time_constant * du'/dt = u - u'"
    finer: ClassVar[float] = 2.0

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "time_constant", "s", 0.15 * robot.scales.time)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        T = p[self.key("time_constant")]
        decay = jnp.exp(-dt / jnp.maximum(T, _TINY * dt))
        mean = T / dt * (1.0 - decay)

        def advance(lagged, row):
            u, keep, share = row
            return u + (lagged - u) * keep, u + (lagged - u) * share

        _, means = jax.lax.scan(advance, jnp.zeros_like(inputs[0]), (inputs, decay, mean))
        return on_drives(robot, inputs, means)


def earlier(time, delay):
    """Where `time - delay` [T] lies between the increasing stamps `time` [T], `delay` >= 0: the stamp before it, and the
    share of the interval from there to the next; before the first stamp, that stamp itself."""
    then = jnp.maximum(time - delay, time[0])
    # At a stamp itself the interval before it: the derivative at no delay is that of a small one.
    before = jnp.clip(jnp.searchsorted(time, then, side="left") - 1, 0, len(time) - 2)
    return before, (then - time[before]) / (time[before + 1] - time[before])


@dataclass(frozen=True)
class InputDelay(Effect):
    """`u'(t) = u(t - delay)`: pure transport delay between logged command and torque; nothing acts before the start."""

    id: ClassVar[str] = "input_delay"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u'(t) = u(t - delay)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "delay", "s", 0.1 * robot.scales.time)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        # The mean of the late input over every step: differences of its integral, which is linear between stamps.
        edges = jnp.concatenate([time, time[-1:] + dt[-1:]])
        whole = jnp.concatenate([jnp.zeros_like(inputs[:1]), jnp.cumsum(inputs * dt[:, None], axis=0)])
        before, share = earlier(edges, p[self.key("delay")])
        late = whole[before] + share[:, None] * (whole[before + 1] - whole[before])
        return on_drives(robot, inputs, jnp.diff(late, axis=0) / dt[:, None])


@dataclass(frozen=True)
class MotorGainMismatch(Effect):
    """`u_i' = (1 + gain_i) u_i`: a motor's gain differs from nominal. What all share is a change of the robot's constants."""

    id: ClassVar[str] = "motor_gain_mismatch"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u_i' = (1 + gain_i) u_i"
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for i in robot.drive_inputs:
            found |= signed(self, f"gain_{robot.channels.inputs[i]}", "", 0.05)
        return found

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        gains = [
            jnp.asarray(p[self.key(f"gain_{name}")] if i in robot.drive_inputs else 0.0, float)
            for i, name in enumerate(robot.channels.inputs)
        ]
        return inputs * (1.0 + jnp.stack(gains))


@dataclass(frozen=True)
class MotorHeating(Effect):
    """Winding resistance `Ra (1 + coefficient * E)` with the energy E dissipated in that winding since the start."""

    id: ClassVar[str] = "motor_heating"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "R = R_cold (1 + coefficient * integral of R i^2)"
    needs: ClassVar[tuple[str, ...]] = ("winding",)

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return tuple(f"heat_{robot.channels.inputs[i]}" for i in robot.drive_inputs)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        scales, winding = robot.scales, robot.parameters[robot.winding].value
        energy = scales.input**2 / winding * scales.duration
        return positive(self, "coefficient", "1/J", 0.3 / energy)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        # A resistance higher by a factor f passes the current of a voltage lowered to emf + (u - emf) / f.
        lowered, winding = list(volts), p[robot.winding]
        for name, k in zip(self.states_on(robot), robot.drive_inputs, strict=True):
            factor = 1.0 + p[self.key("coefficient")] * state[name]
            lowered[k] = volts[k] - winding * currents[k] * (1.0 - 1.0 / factor)
        return tuple(lowered)

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        rates: State = {}
        for name, k in zip(self.states_on(robot), robot.drive_inputs, strict=True):
            rates[name] = p[robot.winding] * (1.0 + p[self.key("coefficient")] * state[name]) * currents[k] ** 2
        return rates
