"""The real supply's limit is lower than what was commanded."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ..curve import Curve, rises_early
from ..effect_parameters import WAYS, positive
from .drives import drive_names, each_drive, input_unit, lost_of_each, on_drives

_SHARES = (0.98, 0.93, 0.85, 0.7, 0.55)
"""Limits that are tried, in shares of the largest input."""


def _cut_at(largest: Mapping[str, float], shares: Sequence[float] = _SHARES) -> tuple[Probe, ...]:
    """Inverse limits by name, together, at shares of what each is the limit of."""
    return tuple(Probe({name: 1 / (s * own) for name, own in largest.items()}, limits=largest) for s in shares)


@dataclass(frozen=True)
class VoltageSaturation(Effect):
    """`u' = clip(u, -limit, limit)` with `inverse_limit = 1 / limit`, zero for no limit."""

    id: ClassVar[str] = "voltage_saturation"
    law: ClassVar[str] = "hard"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u' = clip(u, -limit, limit), limit = 1 / inverse_limit"
    memoryless: ClassVar[bool] = True

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "inverse_limit", f"1/{input_unit(robot)}", 1.0 / robot.scales.input)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        largest = seen.largest_input
        return _cut_at({self.key("inverse_limit"): largest})

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        limited = inputs / jnp.maximum(1.0, jnp.abs(inputs) * p[self.key("inverse_limit")])
        return on_drives(robot, inputs, limited)


@dataclass(frozen=True)
class SoftSaturation(VoltageSaturation):
    """`u' = limit tanh(u / limit)`."""

    law: ClassVar[str] = "tanh"
    formula: ClassVar[str] = "u' = limit tanh(u / limit), limit = 1 / inverse_limit"

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return tuple(
            Probe({self.key("inverse_limit"): 1 / (s * seen.largest_input)}) for s in (3.0, 2.0, 1.4, 1.0, 0.7)
        )

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        x = inputs * p[self.key("inverse_limit")]
        near = jnp.abs(x) < 1e-4  # where the quotient is 0 / 0
        share = jnp.where(near, 1.0 - x * x / 3.0, jnp.tanh(x) / jnp.where(near, 1.0, x))
        return on_drives(robot, inputs, inputs * share)


@dataclass(frozen=True)
class UnequalSaturation(VoltageSaturation):
    """Another limit for negative commands than for positive ones."""

    law: ClassVar[str] = "unequal_limits"
    formula: ClassVar[str] = "u' = clip(u, -limit_backward, limit_forward), limit = 1 / inverse_limit"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, typical = f"1/{input_unit(robot)}", 1.0 / robot.scales.input
        return positive(self, "inverse_limit_forward", unit, typical) | positive(
            self, "inverse_limit_backward", unit, typical
        )

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        names, largest = [self.key(f"inverse_limit_{way}") for way in WAYS], seen.largest_input
        return tuple(probe for name in names for probe in _cut_at({name: largest}))

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        ahead, back = p[self.key("inverse_limit_forward")], p[self.key("inverse_limit_backward")]
        limited = inputs / jnp.maximum(1.0, jnp.maximum(inputs * ahead, -inputs * back))
        return on_drives(robot, inputs, limited)


@dataclass(frozen=True)
class LimitsOfEach(VoltageSaturation):
    """Every drive input with limits of its own, another for negative commands than for positive ones: velocity commands that a
    robot's controller cuts off."""

    law: ClassVar[str] = "per_motor"
    formula: ClassVar[str] = "u_i' = clip(u_i, -limit_backward_i, limit_forward_i), limit = 1 / inverse_limit"
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in drive_names(robot):
            unit, typical = f"1/{robot.channels.units.get(name, '')}", 1.0 / robot.scales.input_of(name)
            for way in WAYS:
                found |= positive(self, f"inverse_limit_{way}_{name}", unit, typical)
        return found

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        largest = {name: robot.scales.input_of(name) for name in drive_names(robot)}
        names = {self.key(f"inverse_limit_{way}_{name}"): own for name, own in largest.items() for way in WAYS}
        return _cut_at(names, _SHARES[::2])  # one by one they are many

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        ahead, back = (each_drive(robot, lambda n, w=way: p[self.key(f"inverse_limit_{w}_{n}")]) for way in WAYS)
        return inputs / jnp.maximum(1.0, jnp.maximum(inputs * ahead, -inputs * back))


@dataclass(frozen=True)
class SaturationCurve(Curve):
    """What is lost of a large command, a curve of its size that goes through zero."""

    id: ClassVar[str] = "voltage_saturation"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u' = u - lost(|u|) sgn u"
    memoryless: ClassVar[bool] = True
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.25, 0.5, 0.75, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3, 4)
    begins_later: ClassVar[bool] = True
    may_as_well: ClassVar[str] = "traction_limit"
    variable: ClassVar[str] = "|u|"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, largest = input_unit(robot), robot.scales.input
        return self.heights_and_reach(robot, unit, 0.05 * largest, unit, largest)

    def parts(self, robot: Robot) -> tuple[str, ...]:
        return tuple(drive_names(robot))

    def agrees(self, robot: Robot) -> bool:
        largest, numbers = np.linspace(0.0, robot.scales.input, 101), robot.parameters.numbers
        lost = [np.asarray(self.at(largest, numbers, name)) for name in self.each(robot)]
        return not rises_early(largest, np.mean(lost, axis=0))

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        size = jnp.abs(inputs)
        lost = jnp.minimum(lost_of_each(self, size, p, robot), size)
        return on_drives(robot, inputs, inputs - lost * jnp.sign(inputs))


LAWS: tuple[Effect, ...] = (
    VoltageSaturation(),
    SoftSaturation(),
    UnequalSaturation(),
    LimitsOfEach(),
    SaturationCurve(),
)
