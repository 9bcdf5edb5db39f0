"""Effects on the body as a whole."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ..parameters import Parameter
from ..robots.effect import Effect, Numbers, Scalars, State
from ..robots.robot import Robot
from .effect_parameters import signed

GRAVITY = 9.81
"""Standard acceleration of free fall, rounded [m/s²]."""


@dataclass(frozen=True)
class GroundSlope(Effect):
    """Tilted floor: gravity `g (slope_x, slope_y)` along the world's x and y, pulling at every body's mass."""

    id: ClassVar[str] = "ground_slope"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "F_world = mass g (slope_x, slope_y)"
    needs: ClassVar[tuple[str, ...]] = ("pose", "weight")

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.03 * robot.scales.acceleration / GRAVITY
        return signed(self, "slope_x", "rad", typical) | signed(self, "slope_y", "rad", typical)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        field = (GRAVITY * p[self.key("slope_x")], GRAVITY * p[self.key("slope_y")])
        added = robot.field_force(field, state, p)
        return tuple(f + extra for f, extra in zip(forces, added, strict=True))


@dataclass(frozen=True)
class QuadraticDrag(Effect):
    """Drag `-coefficient v |v|` on the body's translation."""

    id: ClassVar[str] = "quadratic_drag"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "F = -coefficient v |v|"

    needs: ClassVar[tuple[str, ...]] = ("translation",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "coefficient", drag_unit(robot), 0.025 * robot.scales.force / robot.scales.speed**2)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        linear = robot.translations
        if len(linear) == 1:
            speed = jnp.abs(state[linear[0]])
        else:
            # The small number keeps the derivative of the root finite at standstill.
            speed = jnp.sqrt(sum(state[name] ** 2 for name in linear) + 1e-300)
        changed = list(forces)
        for name in linear:
            axis = robot.velocities.index(name)
            changed[axis] = forces[axis] - p[self.key("coefficient")] * speed * state[name]
        return tuple(changed)


def drag_unit(robot: Robot) -> str:
    """Unit of a force over a speed squared, for the robot's first translation."""
    name = robot.translations[0]
    per = robot.velocity_unit(name).split("/")[0].split(" or ")[0] or "m"
    return f"{robot.force_unit(name)} s^2/{per}^2"


@dataclass(frozen=True)
class Mechanism(Effect):
    """Frees the robot's own parameters that are this mechanism."""

    needs: ClassVar[tuple[str, ...]] = ("mechanism",)

    def frees(self, robot: Robot) -> tuple[str, ...]:
        return robot.mechanisms.get(self.id, ())


@dataclass(frozen=True)
class LateralCentreOfMass(Mechanism):
    """Frees the robot's own lateral centre of mass: xm of the Pioneer, yc (and xc) of the omni."""

    id: ClassVar[str] = "lateral_com_offset"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "centre of mass beside the axis of symmetry"


@dataclass(frozen=True)
class CoriolisCoupling(Mechanism):
    """Frees the share of the turning frame's own terms, which the omni paper's equations lack (0) and nature has (1)."""

    id: ClassVar[str] = "coriolis_coupling"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "M (dV/dt - c W Vn) = ..., M (dVn/dt + c W V) = ..."

    def there_already(self, robot: Robot) -> bool:
        return any(robot.parameters[name].value != 0.0 for name in self.frees(robot))
