"""Rollers, or wheels that slide, resist motion across the robot more than motion along it (Conceição, Moreira and Costa, IEEE
Transactions on Robotics 25, 2009, whose robot has friction along every axis of its body; Shimada et al., ISIE 2005)."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.robot import Robot
from ..body.drag import against
from ..curve import Curve
from ..effect_parameters import shape, signed

_STILL = 0.004
"""Share of the largest sideways speed within which the rollers begin to slide."""


def sideways(robot: Robot) -> tuple[str, ...]:
    """The velocities across the robot's first one."""
    return robot.translations[1:]


def _rubs_itself(robot: Robot, name: str) -> bool:
    """Whether an axis rubs that this velocity alone moves, so that the friction along it is the robot's own."""
    still, numbers = dict.fromkeys(robot.states, 0.0) | robot.initial_state(), robot.parameters.numbers

    def moved(by: str) -> Bool[np.ndarray, " axes"]:
        return np.array([float(speed) for speed in robot.rubbing({**still, by: 1.0}, numbers)]) != 0.0

    others = [moved(other) for other in robot.velocities if other != name]
    return bool(np.any(moved(name) & ~np.any(others, axis=0)))


class _Across(Effect):
    """A force against the motion across the robot's first velocity."""

    def refusal(self, robot: Robot) -> str | None:
        if robot.turning not in robot.velocities:
            return f"{robot.name!r} does not say which velocity is its yaw rate"
        if not sideways(robot):
            return f"{robot.name!r} has no velocity across its first one"
        if all(_rubs_itself(robot, name) for name in sideways(robot)):
            return f"the friction across {robot.name!r} is that of an axis of its own"
        return None


@dataclass(frozen=True)
class SidewaysFriction(_Across):
    """Coulomb and viscous force against motion across the robot; less than none where its axes' own is too much there."""

    id: ClassVar[str] = "sideways_friction"
    law: ClassVar[str] = "coulomb_and_viscous"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "force = -coulomb sgn(sideways speed) - viscous * sideways speed"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in sideways(robot):
            force, fastest, unit = 0.02 * robot.scales.force, robot.scales.output(name), robot.velocity_unit(name)
            found |= signed(self, f"coulomb_{name}", robot.force_unit(name), force)
            per = f"{robot.force_unit(name)}/({unit})" if unit else robot.force_unit(name)
            found |= signed(self, f"viscous_{name}", per, force / fastest)
            found |= shape(self, f"still_{name}", unit, _STILL * fastest, free=False)
        return found

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        resisting = {}
        for name in sideways(robot):
            dry = p[self.key(f"coulomb_{name}")] * jnp.tanh(state[name] / p[self.key(f"still_{name}")])
            resisting[name] = dry + p[self.key(f"viscous_{name}")] * state[name]
        return against(forces, resisting, robot)


@dataclass(frozen=True)
class SidewaysCurve(Curve, _Across):
    """The force against motion across the robot, a curve of the sideways speed."""

    id: ClassVar[str] = "sideways_friction"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "force = -resisting(|sideways speed|) sgn(sideways speed)"
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.1, 0.3, 0.6, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3, 4)
    variable: ClassVar[str] = "|sideways speed|"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        name = sideways(robot)[0]
        unit, fastest = robot.velocity_unit(name), robot.scales.reach(name)
        return self.heights_and_reach(robot, robot.force_unit(name), 0.02 * robot.scales.force, unit, fastest)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        resisting = {name: self.at(jnp.abs(state[name]), p) * jnp.sign(state[name]) for name in sideways(robot)}
        return against(forces, resisting, robot)


LAWS: tuple[Effect, ...] = (SidewaysFriction(), SidewaysCurve())
