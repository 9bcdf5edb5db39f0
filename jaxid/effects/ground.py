"""Effects between the wheels and the floor."""

from dataclasses import dataclass, replace
from typing import ClassVar

import jax.numpy as jnp

from ..parameters import Parameter
from ..robots.effect import Effect, Levels, Numbers, Scalars, State
from ..robots.robot import Robot
from ..robots.trigonometry import sincos
from .body import Mechanism
from .effect_parameters import positive, shape, signed


@dataclass(frozen=True)
class WheelRadiusMismatch(Mechanism):
    """Frees the robot's `radius_mismatch`: effective radii `R (1 + m)` on one side and `R (1 - m)` on the other."""

    id: ClassVar[str] = "wheel_radius_mismatch"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "R_right = R (1 + radius_mismatch), R_left = R (1 - radius_mismatch)"


@dataclass(frozen=True)
class TractionLimit(Effect):
    """Drive force of every wheel limited by the ground: slip. `inverse_limit = 1 / limit`, zero for no limit."""

    id: ClassVar[str] = "traction_limit"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "f' = clip(f, -limit, limit), limit = 1 / inverse_limit"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "inverse_limit", f"1/{robot.ground_force_unit}", 1.1 / robot.scales.force)

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        forces = robot.drive_forces(torques, p)
        inverse = p[self.key("inverse_limit")]
        return tuple(t / jnp.maximum(1.0, jnp.abs(f) * inverse) for t, f in zip(torques, forces, strict=True))


@dataclass(frozen=True)
class SurfaceChange(Effect):
    """Friction of the drivetrain scaled beyond a line on the floor, `x cos(angle) + y sin(angle) > offset`.

    The edge is smooth over the fixed `width`, the way of one integration step. While it is searched for it is `edge` times
    as wide, so that a line in the wrong place still tells where the right one is.
    """

    edge: float = 1.0

    id: ClassVar[str] = "surface_change"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "beyond the line: C' = C (1 + coulomb), B' = B (1 + viscous)"
    needs: ClassVar[tuple[str, ...]] = ("pose", "drive_axes")

    @property
    def blurred(self) -> "SurfaceChange":
        return replace(self, edge=4.0)

    @property
    def sharp(self) -> "SurfaceChange":
        return SurfaceChange()

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        scales = robot.scales
        return (
            signed(self, "coulomb", "", 0.3)
            | signed(self, "viscous", "", 0.3)
            | signed(self, "angle", "rad", 1.0)
            | signed(self, "offset", "m", 0.15 * scales.length)
            | shape(self, "width", "m", 0.25 * scales.speed * scales.interval, free=False)
        )

    def _beyond(self, state: State, p: Numbers):
        sine, cosine = sincos(p[self.key("angle")])
        distance = state["x"] * cosine + state["y"] * sine - p[self.key("offset")]
        return 0.5 * (1.0 + jnp.tanh(distance / (self.edge * p[self.key("width")])))

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        factor, changed = 1.0 + p[self.key("coulomb")] * self._beyond(state, p), list(levels)
        for axis in robot.drive_axes:
            changed[axis] = (levels[axis][0] * factor, levels[axis][1] * factor)
        return tuple(changed)

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        factor, changed = 1.0 + p[self.key("viscous")] * self._beyond(state, p), list(resistance)
        for axis in robot.drive_axes:
            changed[axis] = resistance[axis] * factor
        return tuple(changed)
