"""A moment against turning: wheels that scrub (Mandow et al., IROS 2007; Martínez et al., IJRR 24, 2005)."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ..curve import Curve, falls_at_once
from ..effect_parameters import per_speed, shape, signed, still

_STILL = 0.004
"""Share of the largest yaw rate within which scrubbing wheels begin to slide."""


class _OnTurning(Effect):
    """A moment on the robot's yaw rate."""

    def refusal(self, robot: Robot) -> str | None:
        return None if robot.turns else f"{robot.name!r} does not say which velocity is its yaw rate"


def _units(robot: Robot) -> tuple[str, str]:
    """Of a moment and of the yaw rate; of a robot that has its yaw rate of other velocities, SI's."""
    if robot.turning not in robot.velocities:
        return "N m", "rad/s"
    return robot.force_unit(robot.turning), robot.velocity_unit(robot.turning)


def _moment(robot: Robot) -> float:
    """About the largest moment on the yaw rate."""
    fastest = robot.largest_yaw_rate
    return robot.scales.force * robot.scales.speed / fastest if fastest > 0 else robot.scales.force


def _squared_speed(state: State, p: Numbers, robot: Robot) -> Scalar:
    """The square of the speed at which the robot does not turn."""
    if robot.turning in robot.velocities:
        return jnp.asarray(sum(state[name] ** 2 for name in robot.velocities if name != robot.turning))
    along, left, _ = robot.planar(state, p)
    return along**2 + left**2


@dataclass(frozen=True)
class TurningFriction(_OnTurning):
    """Coulomb and viscous moment against turning."""

    id: ClassVar[str] = "turning_friction"
    law: ClassVar[str] = "coulomb_and_viscous"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "moment = -coulomb sgn(yaw rate) - viscous * yaw rate"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical, rate, (unit, of) = 0.02 * _moment(robot), robot.largest_yaw_rate, _units(robot)
        viscous = per_speed(unit, of or "rad/s").removesuffix("/rad")  # a radian is no unit of a moment's
        found = signed(self, "coulomb", unit, typical) | signed(self, "viscous", viscous, typical / rate)
        return found | still(self, of, _STILL * rate)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        rate = robot.yaw_rate(state, p)
        sign = jnp.tanh(rate / p[self.key("still")])
        return robot.turned(forces, -p[self.key("coulomb")] * sign - p[self.key("viscous")] * rate, p)


@dataclass(frozen=True)
class Scrubbing(TurningFriction):
    """Wheels that scrub more the tighter the turn: Coulomb friction, of which what points sideways counts."""

    law: ClassVar[str] = "by_turn_radius"
    formula: ClassVar[str] = "moment = -coulomb * yaw rate / sqrt(yaw rate^2 + (speed / radius)^2)"

    def refusal(self, robot: Robot) -> str | None:
        return super().refusal(robot) or (
            f"{robot.name!r} does nothing but turn" if len(robot.velocities) < 2 else None
        )

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        rate, (unit, of) = robot.largest_yaw_rate, _units(robot)
        coulomb = signed(self, "coulomb", unit, 0.02 * _moment(robot))
        radius = shape(self, "radius", robot.length_unit, 0.3 * robot.scales.speed / rate)
        return coulomb | radius | still(self, of, _STILL * rate)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        coulomb, radius = self.key("coulomb"), self.key("radius")
        typical = robot.parameters[coulomb].typical or 1.0
        usual = robot.parameters[radius].value
        return tuple(Probe({coulomb: typical}, {radius: times * usual}) for times in (0.3, 1.0, 3.0))

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        rate, squares = robot.yaw_rate(state, p), _squared_speed(state, p, robot)
        sliding = jnp.sqrt(rate**2 + squares / p[self.key("radius")] ** 2 + p[self.key("still")] ** 2)
        return robot.turned(forces, -p[self.key("coulomb")] * rate / sliding, p)


@dataclass(frozen=True)
class FadingScrub(TurningFriction):
    """Wheels that scrub less the faster they roll, by an exponential of the speed: what slides sideways soon rolls on."""

    law: ClassVar[str] = "fading_with_speed"
    formula: ClassVar[str] = "moment = -coulomb exp(-speed / rolling) sgn(yaw rate)"

    def refusal(self, robot: Robot) -> str | None:
        return Scrubbing().refusal(robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        rate, (unit, of) = robot.largest_yaw_rate, _units(robot)
        coulomb = signed(self, "coulomb", unit, 0.02 * _moment(robot))
        rolling = shape(self, "rolling", f"{robot.length_unit}/s", 0.3 * robot.scales.speed)
        return coulomb | rolling | still(self, of, _STILL * rate)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        coulomb, rolling = self.key("coulomb"), self.key("rolling")
        typical, usual = robot.parameters[coulomb].typical or 1.0, robot.parameters[rolling].value
        return tuple(Probe({coulomb: typical}, {rolling: times * usual}) for times in (0.3, 1.0, 3.0))

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        rate = robot.yaw_rate(state, p)
        # The small number keeps the derivative of the root finite at standstill.
        share = jnp.exp(-jnp.sqrt(_squared_speed(state, p, robot) + 1e-300) / p[self.key("rolling")])
        return robot.turned(forces, -p[self.key("coulomb")] * share * jnp.tanh(rate / p[self.key("still")]), p)


@dataclass(frozen=True)
class TurningCurve(Curve, _OnTurning):
    """The moment against turning, a curve of the yaw rate."""

    id: ClassVar[str] = "turning_friction"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "moment = -resisting(|yaw rate|) sgn(yaw rate)"
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.1, 0.3, 0.6, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3, 4)
    variable: ClassVar[str] = "|yaw rate|"
    rather: ClassVar[str] = "stribeck_friction"

    def _falls(self, robot: Robot) -> bool:
        rates, numbers = np.linspace(0.0, robot.parameters[self.key("reach")].value, 101), robot.parameters.numbers
        return falls_at_once(rates, np.asarray(self.at(rates, numbers)))

    def agrees(self, robot: Robot) -> bool:
        """Whether it resists, and is no friction that rises towards standstill."""
        return not self._falls(robot)

    def doubt(self, robot: Robot) -> str:
        return "its moment drives: it is as if dry friction fell once the robot turns" if self._falls(robot) else ""

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, of = _units(robot)
        return self.heights_and_reach(robot, unit, 0.02 * _moment(robot), of, robot.farthest_yaw_rate)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        rate = robot.yaw_rate(state, p)
        return robot.turned(forces, -self.at(jnp.abs(rate), p) * jnp.sign(rate), p)


LAWS: tuple[Effect, ...] = (TurningFriction(), Scrubbing(), FadingScrub(), TurningCurve())
