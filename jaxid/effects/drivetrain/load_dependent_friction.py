"""Friction that grows with the transmitted torque: friction models M3 to M6 of BAM (Rhoban, Better Actuator Models)."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import positive, shape, still

_STILL = 0.01
"""Share of the robot's speed within which a gear is about to turn."""


def _still(effect: Effect, robot: Robot) -> dict[str, Parameter]:
    scales = robot.scales
    return still(effect, f"{robot.angle_unit}/s", _STILL * scales.speed * scales.force / max(scales.torque, 1e-300))


def _refusal(robot: Robot) -> str | None:
    """A drive torque acts at the speed of its wheel's angle or of the axis that declares it."""
    return None if robot.angles or robot.drive_axes else f"{robot.name!r} does not say at which speeds its torques act"


def turning(torques: Scalars, state: State, p: Numbers, robot: Robot, still: Scalar) -> Scalars:
    """Which way every wheel turns, -1 to 1; one that is slower than `still`, the way in which its torque would turn it.

    A gear that stands loses as much before it starts as once it turns: else a wheel would break away by torques that cannot
    move it.
    """
    if set(robot.angles) <= set(robot.own_states):  # states of the robot's own, whose rates are its axes' speeds
        speeds = robot.rubbing(state, p)
        rates = tuple(speeds[axis] for axis in robot.drive_axes)
    else:
        rates = robot.angle_rates(state, p)
    ways = (jnp.clip(rate / still, -1.0, 1.0) for rate in rates)
    return tuple(way + (1.0 - jnp.abs(way)) * jnp.sign(torque) for torque, way in zip(torques, ways, strict=True))


@dataclass(frozen=True)
class LoadDependentFriction(Effect):
    """A share of the drive torque is lost in the gear, whichever way power flows: less drives, more brakes."""

    id: ClassVar[str] = "load_dependent_friction"
    law: ClassVar[str] = "share_of_torque"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "torque' = torque - share |torque| sgn(speed)"

    def refusal(self, robot: Robot) -> str | None:
        return _refusal(robot)

    @property
    def freer(self) -> Effect | None:
        return LoadOfAnyPower(stands_as=self.stands_as)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "share", "", 0.1) | _still(self, robot)

    def _kept(self, torque: Scalar, way: Scalar, p: Numbers) -> Scalar:
        return torque - p[self.key("share")] * jnp.abs(torque) * way

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        ways = turning(torques, state, p, robot, p[self.key("still")])
        return tuple(self._kept(torque, way, p) for torque, way in zip(torques, ways, strict=True))


@dataclass(frozen=True)
class LoadOfAnyPower(LoadDependentFriction):
    """A loss that grows with any power of the torque: rolling contacts and seals lose less than in proportion to it, a gear
    that bends more (the quadratic models of BAM)."""

    law: ClassVar[str] = "power_of_torque"
    restricts: ClassVar[Mapping[str, float]] = MappingProxyType({"exponent": 1.0})
    formula: ClassVar[str] = "torque' = torque - share |torque| (|torque| / largest)^(exponent - 1) sgn(speed)"

    @property
    def freer(self) -> Effect | None:
        return LoadThatBeginsSoftly(stands_as=self.stands_as)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        exponent = Parameter(1.0, "", free=True, lower=0.5, upper=3.0, typical=1.0, source="form")
        largest = shape(self, "largest", robot.torque_unit, robot.scales.torque, free=False)
        return super().parameters(robot) | {self.key("exponent"): exponent} | largest

    def _load(self, torque: Scalar, p: Numbers) -> Scalar:
        return jnp.abs(torque)

    def _kept(self, torque: Scalar, way: Scalar, p: Numbers) -> Scalar:
        load = self._load(torque, p)
        logarithm = 0.5 * jnp.log((load / p[self.key("largest")]) ** 2 + 1e-8)
        grown = jnp.exp((p[self.key("exponent")] - 1.0) * logarithm)
        return torque - p[self.key("share")] * load * grown * way


@dataclass(frozen=True)
class LoadThatBeginsSoftly(LoadOfAnyPower):
    """The same, beginning with the square of small torques: for the question whether the dry friction beside it hangs on what
    is lost where nothing turns yet."""

    law: ClassVar[str] = "begins_softly"
    restricts: ClassVar[Mapping[str, float]] = MappingProxyType({"soft": 0.0})
    formula: ClassVar[str] = "as a power of torque, of sqrt(torque^2 + soft^2) - soft in the place of |torque|"

    @property
    def freer(self) -> Effect | None:
        return None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return super().parameters(robot) | positive(self, "soft", robot.torque_unit, 0.05 * robot.scales.torque)

    def _load(self, torque: Scalar, p: Numbers) -> Scalar:
        soft = p[self.key("soft")]
        return jnp.sqrt(torque**2 + soft**2 + (1e-9 * p[self.key("largest")]) ** 2) - soft


@dataclass(frozen=True)
class TwoEfficiencies(LoadDependentFriction):
    """Another share while the wheel drives the motor than while the motor drives the wheel."""

    law: ClassVar[str] = "driving_and_driven"
    formula: ClassVar[str] = "torque' = torque (1 - driving) while it drives, torque (1 + driven) while it brakes"

    @property
    def freer(self) -> Effect | None:
        return None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "driving", "", 0.1) | positive(self, "driven", "", 0.1) | _still(self, robot)

    def _kept(self, torque: Scalar, way: Scalar, p: Numbers) -> Scalar:
        power = torque * way
        lost = p[self.key("driving")] * jnp.maximum(power, 0.0) + p[self.key("driven")] * jnp.maximum(-power, 0.0)
        return torque - lost * jnp.sign(way)


@dataclass(frozen=True)
class LoadOfAxes(Effect):
    """The same of the axes that rub, where these are not the motors': what is lost grows with what drives such an axis."""

    id: ClassVar[str] = "load_dependent_friction"
    law: ClassVar[str] = "share_of_axis"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "F_i' = F_i + share |drive_i| sgn(speed_i), of the axes that rub"

    def refusal(self, robot: Robot) -> str | None:
        if type(robot).axis_drives is not Robot.axis_drives:
            return None
        return f"the axes of {robot.name!r} that rub are those of its motors"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "share", "", 0.1) | still(self, robot.rim_unit, _STILL * robot.scales.speed)

    def _resists(self, drive: Scalar, way: Scalar, p: Numbers) -> Scalar:
        return p[self.key("share")] * jnp.abs(drive) * way

    def viscous(
        self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot, torques: Scalars = ()
    ) -> Scalars:
        found = []
        for own, rim, drive in zip(resistance, robot.rim_speeds(speeds, p), robot.axis_drives(torques, p), strict=True):
            way = jnp.clip(rim / p[self.key("still")], -1.0, 1.0)
            found.append(own + self._resists(drive, way + (1.0 - jnp.abs(way)) * jnp.sign(drive), p))
        return tuple(found)


@dataclass(frozen=True)
class EfficienciesOfAxes(LoadOfAxes):
    """Another share of it while the axis drives its motors."""

    law: ClassVar[str] = "driving_and_driven_axis"
    formula: ClassVar[str] = "F_i' = F_i + driving |drive_i| sgn(speed_i) while it drives, with driven while it brakes"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        slow = still(self, robot.rim_unit, _STILL * robot.scales.speed)
        return positive(self, "driving", "", 0.1) | positive(self, "driven", "", 0.1) | slow

    def _resists(self, drive: Scalar, way: Scalar, p: Numbers) -> Scalar:
        power = drive * way
        lost = p[self.key("driving")] * jnp.maximum(power, 0.0) + p[self.key("driven")] * jnp.maximum(-power, 0.0)
        return lost * jnp.sign(way)


@dataclass(frozen=True)
class LoadCurve(Curve):
    """What a gear loses of the drive torque, a curve of its size."""

    id: ClassVar[str] = "load_dependent_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "torque' = torque - lost(|torque|) sgn(speed)"
    needs: ClassVar[tuple[str, ...]] = ("torque",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.2, 0.5, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3)
    variable: ClassVar[str] = "|drive torque|"

    def refusal(self, robot: Robot) -> str | None:
        return _refusal(robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, largest = robot.torque_unit, robot.scales.torque
        return self.heights_and_reach(robot, unit, 0.03 * largest, unit, largest) | _still(self, robot)

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        ways = turning(torques, state, p, robot, p[self.key("still")])
        return tuple(t - self.at(jnp.abs(t), p) * way for t, way in zip(torques, ways, strict=True))


LAWS: tuple[Effect, ...] = (
    LoadDependentFriction(),
    LoadOfAnyPower(),
    TwoEfficiencies(),
    LoadOfAxes(),
    EfficienciesOfAxes(),
    LoadCurve(),
)
