"""Effects between the commanded voltage and the motor's torque."""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp

from ..parameters import Parameter
from ..robots.effect import Effect, Numbers, Path, State
from ..robots.robot import Robot
from .effect_parameters import positive, signed

_TINY = 1e-9


@dataclass(frozen=True)
class DeadZone(Effect):
    """`u' = u - clip(u, -threshold, threshold)`: voltage below the threshold does nothing, above it the threshold is lost."""

    id: ClassVar[str] = "actuator_dead_zone"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u' = u - clip(u, -threshold, threshold)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "threshold", robot.channels.units.get(robot.channels.inputs[0], ""), 0.3)

    def command(self, inputs, time, dt, p: Numbers):
        threshold = p[self.key("threshold")]
        return inputs - jnp.clip(inputs, -threshold, threshold)


@dataclass(frozen=True)
class VoltageSaturation(Effect):
    """`u' = clip(u, -limit, limit)` with `inverse_limit = 1 / limit`, zero for no limit."""

    id: ClassVar[str] = "voltage_saturation"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u' = clip(u, -limit, limit), limit = 1 / inverse_limit"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit = robot.channels.units.get(robot.channels.inputs[0], "")
        return positive(self, "inverse_limit", f"1/{unit}", 0.1)

    def command(self, inputs, time, dt, p: Numbers):
        return inputs / jnp.maximum(1.0, jnp.abs(inputs) * p[self.key("inverse_limit")])


@dataclass(frozen=True)
class BatterySag(Effect):
    """Supply with inner resistance: the voltages of all motors drop with the total current drawn through their choppers.

    A motor's chopper with duty `u / nominal` draws duty times its current; the supply is `nominal - resistance * total`,
    which is solved for exactly since the currents are linear in it.
    """

    nominal: float = 12.0

    id: ClassVar[str] = "battery_sag"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "supply = nominal - resistance * sum(duty * current)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "resistance", "ohm", 0.1)

    def supply(self, volts: Path, currents: Path, state: State, p: Numbers) -> Path:
        r, above, below = p[self.key("resistance")], self.nominal, 1.0
        for u, i in zip(volts, currents, strict=True):
            duty = u / self.nominal
            above = above + r * duty * (u - p["Ra"] * i) / p["Ra"]  # the back-EMF pushes back
            below = below + r * duty * duty / p["Ra"]
        share = above / below / self.nominal
        return tuple(u * share for u in volts)


@dataclass(frozen=True)
class MotorLag(Effect):
    """First-order lag between command and torque: `T du'/dt = u - u'`, its exact mean over every integration step."""

    id: ClassVar[str] = "motor_lag"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "time_constant * du'/dt = u - u'"
    max_step: ClassVar[float] = 0.005

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "time_constant", "s", 0.03)

    def command(self, inputs, time, dt, p: Numbers):
        T = p[self.key("time_constant")]
        decay = jnp.exp(-dt / jnp.maximum(T, _TINY))
        mean = T / dt * (1.0 - decay)

        def advance(lagged, row):
            u, keep, share = row
            return u + (lagged - u) * keep, u + (lagged - u) * share

        _, means = jax.lax.scan(advance, jnp.zeros_like(inputs[0]), (inputs, decay, mean))
        return means


def delayed(signal, shift):
    """Rows of `signal` [T, n] `shift` >= 0 rows late, between rows in proportion; before the start, its first row."""
    whole = jnp.floor(shift)
    part = shift - whole
    index = jnp.arange(signal.shape[0]) - whole.astype(int)
    late, later = jnp.clip(index, 0, None), jnp.clip(index - 1, 0, None)
    return (1.0 - part) * signal[late] + part * signal[later]


@dataclass(frozen=True)
class InputDelay(Effect):
    """`u'(t) = u(t - delay)`: pure transport delay between logged command and torque; nothing acts before the start."""

    id: ClassVar[str] = "input_delay"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u'(t) = u(t - delay)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "delay", "s", 0.02)

    def command(self, inputs, time, dt, p: Numbers):
        # One row of zeros in front: before the log begins nothing is commanded.
        padded = jnp.concatenate([jnp.zeros_like(inputs[:1]), inputs])
        return delayed(padded, p[self.key("delay")] / dt[0])[1:]


@dataclass(frozen=True)
class MotorGainMismatch(Effect):
    """`u_i' = (1 + gain_i) u_i`: a motor's gain differs from nominal. What all share is a change of the robot's constants."""

    id: ClassVar[str] = "motor_gain_mismatch"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u_i' = (1 + gain_i) u_i"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in robot.channels.inputs:
            found |= signed(self, f"gain_{name}", "", 0.05)
        return found

    def command(self, inputs, time, dt, p: Numbers):
        names = [key for key in p if key.startswith(self.key("gain_"))]
        return inputs * (1.0 + jnp.stack([jnp.asarray(p[name], float) for name in names]))


@dataclass(frozen=True)
class MotorHeating(Effect):
    """Winding resistance `Ra (1 + coefficient * E)` with the energy E dissipated in that winding since the start."""

    motors: tuple[str, ...] = ("V2", "V3")

    id: ClassVar[str] = "motor_heating"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "R = Ra (1 + coefficient * integral of R i^2)"

    @property
    def states(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(f"heat_{name}" for name in self.motors)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "coefficient", "1/J", 1e-4)

    def supply(self, volts: Path, currents: Path, state: State, p: Numbers) -> Path:
        # A resistance higher by a factor f passes the current of a voltage lowered to emf + (u - emf) / f.
        lowered = []
        for name, u, i in zip(self.states, volts, currents, strict=True):
            factor = 1.0 + p[self.key("coefficient")] * state[name]
            lowered.append(u - p["Ra"] * i * (1.0 - 1.0 / factor))
        return tuple(lowered)

    def rates(self, state: State, currents: Path, p: Numbers) -> State:
        rates: State = {}
        for name, i in zip(self.states, currents, strict=True):
            rates[name] = p["Ra"] * (1.0 + p[self.key("coefficient")] * state[name]) * i * i
        return rates
