"""A driver that lets the motor run free when nothing is commanded, instead of braking it through the winding."""

from dataclasses import dataclass, replace
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ..effect_parameters import positive, shape
from .drives import back_emf, input_unit


@dataclass(frozen=True)
class FreewheelingDriver(Effect):
    """Below a `threshold` of the command no current flows (`share` of the time): no torque and no braking by the back-EMF.
    H-bridge data sheets call it coasting, or fast decay.

    The step at the threshold is `edge` of it wide, more while it is searched for.
    """

    edge: float = 0.05

    id: ClassVar[str] = "freewheeling_driver"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "i = (1 - share) (u - back-EMF) / R where |u| < threshold"
    needs: ClassVar[tuple[str, ...]] = ("winding",)

    @property
    def blurred(self) -> "FreewheelingDriver":
        return replace(self, edge=0.6)

    @property
    def sharp(self) -> "FreewheelingDriver":
        return replace(self, edge=0.05)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "share", "", 1.0) | shape(self, "threshold", input_unit(robot), 0.05 * robot.scales.input)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        share, threshold = self.key("share"), self.key("threshold")
        return tuple(Probe({share: 1.0}, {threshold: size * seen.largest_input}) for size in (0.01, 0.05, 0.12, 0.3))

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed, threshold = list(volts), p[self.key("threshold")]
        for k in robot.drive_inputs:
            below = jnp.clip((threshold - jnp.abs(volts[k])) / (self.edge * threshold) + 0.5, 0.0, 1.0)
            emf = back_emf(volts, currents, k, p, robot)
            changed[k] = volts[k] + p[self.key("share")] * below * (emf - volts[k])
        return tuple(changed)


LAWS: tuple[Effect, ...] = (FreewheelingDriver(),)
