"""A driver that lets the motor run free when nothing is commanded, instead of braking it through the winding."""

from dataclasses import dataclass, replace
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import positive, shape
from .drives import back_emf, input_unit

_SHARP = 0.05
"""Width of the step at the threshold, in shares of it."""


@dataclass(frozen=True)
class FreewheelingDriver(Effect):
    """Below a `threshold` of the command no current flows (`share` of the time): no torque and no braking by the back-EMF.
    H-bridge data sheets call it coasting, or fast decay.

    The step at the threshold is `edge` of it wide, more while it is searched for.
    """

    edge: float = _SHARP

    id: ClassVar[str] = "freewheeling_driver"
    law: ClassVar[str] = "below_a_threshold"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "i = (1 - share) (u - back-EMF) / R where |u| < threshold"
    needs: ClassVar[tuple[str, ...]] = ("winding",)

    @property
    def blurred(self) -> "FreewheelingDriver":
        return replace(self, edge=0.6)

    @property
    def sharp(self) -> "FreewheelingDriver":
        return replace(self, edge=_SHARP)

    @property
    def sharper(self) -> "FreewheelingDriver":
        return replace(self, edge=max(0.25 * self.edge, _SHARP))

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


def _less(volts: Scalar, current: Scalar, emf: Scalar, share: Scalar) -> Scalar:
    """The voltage with which a `share` of the current that brakes, against the command, does not flow."""
    return volts + share * jnp.where(current * volts <= 0.0, 1.0, 0.0) * (emf - volts)


@dataclass(frozen=True)
class NoBraking(Effect):
    """A driver whose diodes let a current against the command pass in part only, whatever the command: it hardly brakes."""

    id: ClassVar[str] = "freewheeling_driver"
    law: ClassVar[str] = "against_the_command"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "i = (1 - share) (u - back-EMF) / R where that is against u"
    needs: ClassVar[tuple[str, ...]] = ("winding",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "share", "", 0.5)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed = list(volts)
        for k in robot.drive_inputs:
            emf = back_emf(volts, currents, k, p, robot)
            changed[k] = _less(volts[k], currents[k], emf, p[self.key("share")])
        return tuple(changed)


@dataclass(frozen=True)
class BrakingCurve(Curve):
    """The share of a current against the command that does not flow, a curve of the command; none beyond the reach."""

    id: ClassVar[str] = "freewheeling_driver"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "i = (1 - share(|u|)) (u - back-EMF) / R where that is against u"
    needs: ClassVar[tuple[str, ...]] = ("winding",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.3, 0.6, 1.0)
    free: ClassVar[tuple[int, ...]] = (0, 1, 2)
    variable: ClassVar[str] = "|u|"
    reaches: ClassVar[tuple[float, ...]] = (0.4, 1.0)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return self.heights_and_reach(robot, "", 0.5, input_unit(robot), robot.scales.input)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed = list(volts)
        for k in robot.drive_inputs:
            emf = back_emf(volts, currents, k, p, robot)
            changed[k] = _less(volts[k], currents[k], emf, self.at(jnp.abs(volts[k]), p))
        return tuple(changed)


LAWS: tuple[Effect, ...] = (FreewheelingDriver(), NoBraking(), BrakingCurve())
