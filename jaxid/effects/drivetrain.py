"""Effects of friction and gears. Speeds are at the wheels' rims [m/s], so that axes of different kinds share them."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ..parameters import Parameter
from ..robots.effect import Effect, Levels, Numbers, Path, State
from ..robots.robot import Robot
from ..robots.trigonometry import sincos
from .effect_parameters import positive, shape, signed


@dataclass(frozen=True)
class _OnDriveAxes(Effect):
    """An effect that acts on the drivetrain's rubbing axes of one robot."""

    robot: Robot

    def _rims(self, speeds: Path, p: Numbers) -> Path:
        return self.robot.rim_speeds(speeds, p)


@dataclass(frozen=True)
class StribeckFriction(_OnDriveAxes):
    """Coulomb level higher by `amplitude` at standstill, the excess falling off as a Gaussian of the speed (Stribeck)."""

    id: ClassVar[str] = "stribeck_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = C + amplitude * exp(-(s / speed)^2)"
    max_step: ClassVar[float] = 0.005  # friction falls off within a step or two of starting to slide

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, typical = {"pioneer": ("N m", 0.1), "omni": ("N", 10.0)}.get(robot.name, ("N", 1.0))
        return positive(self, "amplitude", unit, typical) | shape(self, "speed", "m/s", 0.05)

    def dry(self, levels: Levels, speeds: Path, state: State, p: Numbers) -> Levels:
        rims, changed = self._rims(speeds, p), list(levels)
        for axis in self.robot.drive_axes:
            rise = p[self.key("amplitude")] * jnp.exp(-((rims[axis] / p[self.key("speed")]) ** 2))
            if self.robot.name == "omni" and self.robot.velocities[axis] == "W":
                rise = p["b"] * rise  # the omni's turning axis: the same force at the rim
            backward, forward = levels[axis]
            changed[axis] = (backward + rise, forward + rise)
        return tuple(changed)


@dataclass(frozen=True)
class AsymmetricFriction(_OnDriveAxes):
    """Coulomb levels `C (1 + asymmetry)` forwards and `C (1 - asymmetry)` backwards."""

    id: ClassVar[str] = "asymmetric_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = C (1 + asymmetry sgn s)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "asymmetry", "", 0.1)

    def dry(self, levels: Levels, speeds: Path, state: State, p: Numbers) -> Levels:
        a, changed = p[self.key("asymmetry")], list(levels)
        for axis in self.robot.drive_axes:
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

    def viscous(self, resistance: Path, speeds: Path, state: State, p: Numbers) -> Path:
        changed = list(resistance)
        for axis in self.robot.drive_axes:
            changed[axis] = resistance[axis] * (1.0 + p[self.key("asymmetry")] * jnp.sign(speeds[axis]))
        return tuple(changed)


@dataclass(frozen=True)
class SublinearViscousFriction(_OnDriveAxes):
    """Viscous friction `B s (|s| / 0.5 m/s)^-deficit`: it grows slower than the speed."""

    id: ClassVar[str] = "sublinear_viscous_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "F = B s (|s| / 0.5 m/s)^-deficit"
    reference: ClassVar[float] = 0.5

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "deficit", "", 0.1)

    def viscous(self, resistance: Path, speeds: Path, state: State, p: Numbers) -> Path:
        rims, changed = self._rims(speeds, p), list(resistance)
        for axis in self.robot.drive_axes:
            # Half the logarithm of s², kept finite at standstill where the friction itself vanishes.
            logarithm = 0.5 * jnp.log((rims[axis] / self.reference) ** 2 + 1e-8)
            changed[axis] = resistance[axis] * jnp.exp(-p[self.key("deficit")] * logarithm)
        return tuple(changed)


@dataclass(frozen=True)
class CoggingTorque(_OnDriveAxes):
    """Torque ripple `a sin(n phi) + b cos(n phi)` with every driving wheel's angle phi since the start."""

    id: ClassVar[str] = "cogging_torque"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "torque' = torque + sine * sin(periods * phi) + cosine * cos(periods * phi)"
    needs: ClassVar[tuple[str, ...]] = ("wheel_angles",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for angle in robot.angles:
            unit, typical = ("N m", 0.1) if robot.name != "axis" else ("N", 0.5)
            found |= signed(self, f"sine_{angle}", unit, typical) | signed(self, f"cosine_{angle}", unit, typical)
        return found | shape(self, "periods", "1/rad" if robot.name != "axis" else "1/m", 6.0)

    def torque(self, torques: Path, state: State, p: Numbers) -> Path:
        rippled = []
        for torque, angle in zip(torques, self.robot.angles, strict=True):
            sine, cosine = sincos(p[self.key("periods")] * state[angle])
            ripple = p[self.key(f"sine_{angle}")] * sine + p[self.key(f"cosine_{angle}")] * cosine
            # The omni's stage passes forces at the rim, the others torques (or forces) at the wheel itself.
            rippled.append(torque + (ripple / p["r"] if self.robot.name == "omni" else ripple))
        return tuple(rippled)
