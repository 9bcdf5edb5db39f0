"""A driver that lets the motor run free when nothing is commanded, instead of braking it through the winding."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.robot import Robot
from ..effect_parameters import positive, shape
from .drives import back_emf, input_unit


@dataclass(frozen=True)
class FreewheelingDriver(Effect):
    """Below the fixed `threshold` of the command no current flows (`share` of the time): no torque and no braking by the
    back-EMF. H-bridge data sheets call it coasting, or fast decay."""

    id: ClassVar[str] = "freewheeling_driver"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "i = (1 - share) (u - back-EMF) / R where |u| < threshold"
    needs: ClassVar[tuple[str, ...]] = ("winding",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found = positive(self, "share", "", 1.0)
        return found | shape(self, "threshold", input_unit(robot), 0.01 * robot.scales.input, free=False)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed = list(volts)
        for k in robot.drive_inputs:
            idle = jnp.where(jnp.abs(volts[k]) < p[self.key("threshold")], p[self.key("share")], 0.0)
            changed[k] = volts[k] + idle * (back_emf(volts, currents, k, p, robot) - volts[k])
        return tuple(changed)


LAWS: tuple[Effect, ...] = (FreewheelingDriver(),)
