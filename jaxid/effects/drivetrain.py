"""Effects of friction and gears. Speeds are at the wheels' rims [m/s], so that axes of different kinds share them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ..parameters import Parameter
from ..robots.effect import Effect, Levels, Numbers, Scalar, Scalars, State
from ..robots.robot import Robot
from ..robots.trigonometry import sincos
from .effect_parameters import positive, shape, signed


@dataclass(frozen=True)
class _OnDriveAxes(Effect):
    """An effect that acts on the drivetrain's rubbing axes."""

    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)


def risen(
    levels: Levels, axes: Sequence[int], speeds: Scalars, p: Numbers, robot: Robot, amplitude: Scalar, speed: Scalar
) -> Levels:
    """Coulomb levels of the `axes` higher by `amplitude` at standstill, the excess falling off as a Gaussian of the speed at
    the rim (Stribeck): within `speed` to 37 %."""
    rims, levers, changed = robot.rim_speeds(speeds, p), robot.rim_levers(p), list(levels)
    for axis in axes:
        rise = amplitude * jnp.exp(-((rims[axis] / speed) ** 2))
        if levers[axis] is not levers[axes[0]]:
            rise = rise * (levers[axis] / levers[axes[0]])  # an axis with another lever: the same force at the rim
        backward, forward = levels[axis]
        changed[axis] = (backward + rise, forward + rise)
    return tuple(changed)


@dataclass(frozen=True)
class StribeckFriction(_OnDriveAxes):
    """Coulomb level higher by `amplitude` at standstill, the excess falling off as a Gaussian of the speed (Stribeck)."""

    id: ClassVar[str] = "stribeck_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = C + amplitude * exp(-(s / speed)^2)"
    finer: ClassVar[float] = 2.0  # friction falls off within a step or two of starting to slide

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.02 * robot.scales.friction
        return positive(self, "amplitude", robot.friction_unit, typical) | shape(
            self, "speed", robot.rim_unit, 0.05 * robot.scales.speed
        )

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        amplitude, speed = p[self.key("amplitude")], p[self.key("speed")]
        return risen(levels, robot.drive_axes, speeds, p, robot, amplitude, speed)


@dataclass(frozen=True)
class AsymmetricFriction(_OnDriveAxes):
    """Coulomb levels `C (1 + asymmetry)` forwards and `C (1 - asymmetry)` backwards."""

    id: ClassVar[str] = "asymmetric_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = C (1 + asymmetry sgn s)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "asymmetry", "", 0.1)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        a, changed = p[self.key("asymmetry")], list(levels)
        for axis in robot.drive_axes:
            backward, forward = levels[axis]
            changed[axis] = (backward * (1.0 - a), forward * (1.0 + a))
        return tuple(changed)


@dataclass(frozen=True)
class AsymmetricViscousFriction(_OnDriveAxes):
    """Viscous coefficients `B (1 + asymmetry)` forwards and `B (1 - asymmetry)` backwards."""

    id: ClassVar[str] = "asymmetric_viscous_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "B' = B (1 + asymmetry sgn s)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "asymmetry", "", 0.1)

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed = list(resistance)
        for axis in robot.drive_axes:
            changed[axis] = resistance[axis] * (1.0 + p[self.key("asymmetry")] * jnp.sign(speeds[axis]))
        return tuple(changed)


@dataclass(frozen=True)
class SublinearViscousFriction(_OnDriveAxes):
    """Viscous friction `B s (|s| / reference)^-deficit`: it grows slower than the speed.

    The fixed `reference` is the speed at which B stays what it is.
    """

    id: ClassVar[str] = "sublinear_viscous_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "F = B s (|s| / reference)^-deficit"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        reference = shape(self, "reference", robot.rim_unit, 0.5 * robot.scales.speed, free=False)
        return signed(self, "deficit", "", 0.1) | reference

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        rims, changed = robot.rim_speeds(speeds, p), list(resistance)
        for axis in robot.drive_axes:
            # Half the logarithm of s², kept finite at standstill where the friction itself vanishes.
            logarithm = 0.5 * jnp.log((rims[axis] / p[self.key("reference")]) ** 2 + 1e-8)
            changed[axis] = resistance[axis] * jnp.exp(-p[self.key("deficit")] * logarithm)
        return tuple(changed)


@dataclass(frozen=True)
class CoggingTorque(_OnDriveAxes):
    """Torque ripple `a sin(n phi) + b cos(n phi)` with every driving wheel's angle phi since the start."""

    id: ClassVar[str] = "cogging_torque"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "torque' = torque + sine * sin(periods * phi) + cosine * cos(periods * phi)"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes", "wheel_angles")
    finer: ClassVar[float] = 2.0  # a period may pass within a few of the robot's own steps

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        unit, typical = robot.torque_unit, 0.02 * robot.scales.torque
        for angle in robot.angles:
            found |= signed(self, f"sine_{angle}", unit, typical) | signed(self, f"cosine_{angle}", unit, typical)
        return found | shape(self, "periods", f"1/{robot.angle_unit}", 6.0 / robot.scales.angle)

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        rippled = []
        for torque, angle in zip(torques, robot.angles, strict=True):
            sine, cosine = sincos(p[self.key("periods")] * state[angle])
            rippled.append(torque + p[self.key(f"sine_{angle}")] * sine + p[self.key(f"cosine_{angle}")] * cosine)
        return tuple(rippled)
