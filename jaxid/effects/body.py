"""Effects on the body as a whole."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ..parameters import Parameter
from ..robots.effect import Effect, Numbers, Path, State
from ..robots.robot import Robot
from .effect_parameters import signed

GRAVITY = 9.81
"""Standard acceleration of free fall, rounded [m/s²]."""


@dataclass(frozen=True)
class GroundSlope(Effect):
    """Tilted floor: gravity `g (slope_x, slope_y)` along the world's x and y, pulling at every body's mass."""

    robot: Robot

    id: ClassVar[str] = "ground_slope"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "F_world = mass g (slope_x, slope_y)"
    needs: ClassVar[tuple[str, ...]] = ("pose",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "slope_x", "rad", 0.02) | signed(self, "slope_y", "rad", 0.02)

    def force(self, forces: Path, state: State, p: Numbers) -> Path:
        field = (GRAVITY * p[self.key("slope_x")], GRAVITY * p[self.key("slope_y")])
        added = self.robot.field_force(field, state, p)
        return tuple(f + extra for f, extra in zip(forces, added, strict=True))


@dataclass(frozen=True)
class QuadraticDrag(Effect):
    """Drag `-coefficient v |v|` on the body's translation."""

    robot: Robot

    id: ClassVar[str] = "quadratic_drag"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "F = -coefficient v |v|"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "coefficient", "N s^2/m^2", 1.0)

    def force(self, forces: Path, state: State, p: Numbers) -> Path:
        linear = [name for name in self.robot.velocities if name not in ("eta2", "W")]
        # The small number keeps the derivative of the root finite at standstill.
        speed = jnp.sqrt(sum(state[name] ** 2 for name in linear) + 1e-12)
        changed = list(forces)
        for name in linear:
            axis = self.robot.velocities.index(name)
            changed[axis] = forces[axis] - p[self.key("coefficient")] * speed * state[name]
        return tuple(changed)


@dataclass(frozen=True)
class LateralCentreOfMass(Effect):
    """Frees the robot's own lateral centre of mass: xm of the Pioneer, yc (and xc) of the omni."""

    frees: tuple[str, ...] = ("xm",)  # pyright: ignore[reportIncompatibleVariableOverride]

    id: ClassVar[str] = "lateral_com_offset"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "centre of mass beside the axis of symmetry"


@dataclass(frozen=True)
class CoriolisCoupling(Effect):
    """Frees the share of the turning frame's own terms, which the omni paper's equations lack (0) and nature has (1)."""

    frees: tuple[str, ...] = ("coriolis",)  # pyright: ignore[reportIncompatibleVariableOverride]

    id: ClassVar[str] = "coriolis_coupling"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "M (dV/dt - c W Vn) = ..., M (dVn/dt + c W V) = ..."
