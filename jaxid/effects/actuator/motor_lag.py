"""The torque follows its command late and smoothly: driver filters, winding inductance, inner loops."""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.probe import Probe, Seen, one_by_one
from ...robots.robot import Robot
from ..effect_parameters import positive
from .drives import back_emf, on_drives

_TINY = 1e-9
"""Share of a step below which a time constant is none."""


def low_passed(inputs, dt, T):
    """`inputs` [T, nu] held over steps `dt` behind a first-order lag of time constant `T`: its exact mean over every step."""
    decay = jnp.exp(-dt / jnp.maximum(T, _TINY * dt))
    mean = T / dt * (1.0 - decay)

    def advance(lagged, row):
        u, keep, share = row
        return u + (lagged - u) * keep, u + (lagged - u) * share

    _, means = jax.lax.scan(advance, jnp.zeros_like(inputs[0]), (inputs, decay, mean))
    return means


@dataclass(frozen=True)
class MotorLag(Effect):
    """First-order lag between command and torque: `T du'/dt = u - u'`, its exact mean over every integration step."""

    id: ClassVar[str] = "motor_lag"
    law: ClassVar[str] = "first_order"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "time_constant * du'/dt = u - u'"
    finer: ClassVar[float] = 2.0

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "time_constant", "s", 0.15 * robot.scales.time)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("time_constant"), robot.scales.times_to_try)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return on_drives(robot, inputs, low_passed(inputs, dt, p[self.key("time_constant")]))


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

    def _shortest(self, robot: Robot) -> float:
        """The time constant below which the late back-EMF fades into the present one, for integration's sake."""
        return 0.3 * robot.scales.interval

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        T, shortest, changed = p[self.key("time_constant")], self._shortest(robot), list(volts)
        share = T / jnp.maximum(T, shortest)
        for name, k in zip(self.states_on(robot), robot.drive_inputs, strict=True):
            changed[k] = volts[k] + share * (back_emf(volts, currents, k, p, robot) - state[name])
        return tuple(changed)

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        T = jnp.maximum(p[self.key("time_constant")], self._shortest(robot))
        idle = robot.motor((0.0,) * len(currents), state, p)  # the currents that the back-EMF alone would drive
        named = zip(self.states_on(robot), robot.drive_inputs, strict=True)
        return {name: (-p[robot.winding] * idle[k] - state[name]) / T for name, k in named}


LAWS: tuple[Effect, ...] = (MotorLag(), SecondOrderLag(), Inductance())
