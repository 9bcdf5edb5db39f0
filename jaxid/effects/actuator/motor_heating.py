"""A motor that has run for a while is weaker: copper's resistance rises by 0.39 %/K, magnets weaken by 0.1 to 0.2 %/K."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import positive, shape, shortest
from .drives import back_emf, one_torque_each


def _time_to_cool(effect: Effect, robot: Robot) -> dict[str, Parameter]:
    slow = shape(effect, "time_constant", "s", 0.3 * robot.scales.duration)
    return slow | shortest(effect, 2.0 * robot.scales.interval)


def _less_what_leaves(effect: Effect, gained: State, state: State, p: Numbers) -> State:
    """The rates of the heats that gain so many watts and lose theirs by one time constant."""
    slow = jnp.maximum(p[effect.key("time_constant")], p[effect.key("shortest")])
    return {name: watts - state[name] / slow for name, watts in gained.items()}


@dataclass(frozen=True)
class MotorHeating(Effect):
    """Winding resistance `Ra (1 + coefficient * E)` with the energy E dissipated in that winding since the start."""

    since_start: ClassVar[bool] = True
    id: ClassVar[str] = "motor_heating"
    law: ClassVar[str] = "stored_energy"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "R = R_cold (1 + coefficient * integral of R i^2)"
    needs: ClassVar[tuple[str, ...]] = ("winding",)

    @property
    def freer(self) -> Effect | None:
        return HeatingThatLevelsOff(stands_as=self.stands_as) if self.law == MotorHeating.law else None

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return tuple(self.own(f"heat_{robot.channels.inputs[i]}") for i in robot.drive_inputs)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        scales, winding = robot.scales, robot.parameters[robot.winding].value
        energy = scales.input**2 / winding * scales.duration
        return positive(self, "coefficient", "1/J", 0.3 / energy)

    def rise(self, heat: Scalar, p: Numbers) -> Scalar:
        """Of the resistance, relative, with the energy `heat` [J]."""
        return p[self.key("coefficient")] * heat

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        # A resistance higher by a factor f passes the current of a voltage lowered to emf + (u - emf) / f.
        lowered, winding = list(volts), p[robot.winding]
        for name, k in zip(self.states_on(robot), robot.drive_inputs, strict=True):
            factor = 1.0 + self.rise(state[name], p)
            lowered[k] = volts[k] - winding * currents[k] * (1.0 - 1.0 / factor)
        return tuple(lowered)

    def _watts(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        """Power dissipated in every winding, by the name of its heat."""
        return {
            name: p[robot.winding] * (1.0 + self.rise(state[name], p)) * currents[k] ** 2
            for name, k in zip(self.states_on(robot), robot.drive_inputs, strict=True)
        }

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        return self._watts(state, currents, p, robot)


@dataclass(frozen=True)
class HeatingThatLevelsOff(MotorHeating):
    """A resistance that rises less and less: for the question whether the robot's own parameters hang on that."""

    law: ClassVar[str] = "levelling_off"
    restricts: ClassVar[Mapping[str, float]] = MappingProxyType({"levelling": 0.0})
    formula: ClassVar[str] = "R = R_cold (1 + coefficient * E / (1 + levelling * E)), E = integral of R i^2"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        rise = super().parameters(robot)
        (typical,) = (parameter.typical for parameter in rise.values())
        return rise | positive(self, "levelling", "1/J", typical or 1.0)

    def rise(self, heat: Scalar, p: Numbers) -> Scalar:
        return super().rise(heat, p) / (1.0 + p[self.key("levelling")] * heat)


@dataclass(frozen=True)
class HeatingWithCooling(MotorHeating):
    """The same with heat that leaves by one time constant."""

    law: ClassVar[str] = "with_cooling"
    formula: ClassVar[str] = "R = R_cold (1 + coefficient * E), dE/dt = R i^2 - E / time_constant"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return super().parameters(robot) | _time_to_cool(self, robot)

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        return _less_what_leaves(self, self._watts(state, currents, p, robot), state, p)


@dataclass(frozen=True)
class WeakerMagnets(MotorHeating):
    """Torque and back-EMF constants that fall with the energy dissipated."""

    law: ClassVar[str] = "torque_constant"
    formula: ClassVar[str] = "Kt = Kt_cold (1 - coefficient * integral of R i^2), Ke alike"

    def refusal(self, robot: Robot) -> str | None:
        if one_torque_each(robot):
            return None
        return f"{robot.name!r} has not one drive torque for every drive input, so that {self.title} has none to change"

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed = list(volts)
        for name, k in zip(self.states_on(robot), robot.drive_inputs, strict=True):
            changed[k] = volts[k] + p[self.key("coefficient")] * state[name] * back_emf(volts, currents, k, p, robot)
        return tuple(changed)

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        weaker = [1.0 - p[self.key("coefficient")] * state[name] for name in self.states_on(robot)]
        return tuple(t * factor for t, factor in zip(torques, weaker, strict=True))

    def _watts(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        named = zip(self.states_on(robot), robot.drive_inputs, strict=True)
        return {name: p[robot.winding] * currents[k] ** 2 for name, k in named}


@dataclass(frozen=True)
class WeakerMagnetsThatCool(WeakerMagnets):
    """The same with heat that leaves by one time constant."""

    law: ClassVar[str] = "torque_constant_with_cooling"
    formula: ClassVar[str] = "Kt = Kt_cold (1 - coefficient * E), Ke alike, dE/dt = R i^2 - E / time_constant"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return super().parameters(robot) | _time_to_cool(self, robot)

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        return _less_what_leaves(self, self._watts(state, currents, p, robot), state, p)


@dataclass(frozen=True)
class HeatingCurve(Curve):
    """The rise of the winding's resistance, a curve of the energy i² R that was dissipated in it."""

    since_start: ClassVar[bool] = True
    id: ClassVar[str] = "motor_heating"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "R = R_cold (1 + rise(integral of R_cold i^2))"
    needs: ClassVar[tuple[str, ...]] = ("winding",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.25, 0.5, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3)
    variable: ClassVar[str] = "energy dissipated in the winding"

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return tuple(self.own(f"heat_{robot.channels.inputs[i]}") for i in robot.drive_inputs)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        scales, winding = robot.scales, robot.parameters[robot.winding].value
        return self.heights_and_reach(robot, "", 0.1, "J", 0.3 * scales.input**2 / winding * scales.duration)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        lowered, winding = list(volts), p[robot.winding]
        for name, k in zip(self.states_on(robot), robot.drive_inputs, strict=True):
            lowered[k] = volts[k] - winding * currents[k] * (1.0 - 1.0 / (1.0 + self.at(state[name], p)))
        return tuple(lowered)

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        named = zip(self.states_on(robot), robot.drive_inputs, strict=True)
        return {name: p[robot.winding] * currents[k] ** 2 for name, k in named}


LAWS: tuple[Effect, ...] = (
    MotorHeating(),
    HeatingWithCooling(),
    WeakerMagnets(),
    WeakerMagnetsThatCool(),
    HeatingCurve(),
)
