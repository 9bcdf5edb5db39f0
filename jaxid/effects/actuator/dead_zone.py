"""Commands too small to move anything: what an H-bridge and its dead time do near zero (data sheets; FRC's kS)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.probe import Probe, Seen, one_by_one
from ...robots.robot import Robot
from ..curve import Curve, rises_early
from ..effect_parameters import WAYS, positive
from .drives import (
    drive_names,
    each_drive,
    input_unit,
    lost_of_each,
    on_drives,
    one_torque_each,
    torque_falls_with_speed,
)

_SHARES = (0.01, 0.03, 0.08, 0.2, 0.4)
"""Dead zones that are tried, in shares of the largest input."""
_TINY, _NOTHING = 1e-6, 1e-30
"""Threshold, in shares of a command, below which there is none, and what keeps a ratio of zeros a number."""
_SHARP = 0.01
"""Width of the step at a threshold, in shares of it."""


def _hyperbola(shares: Any) -> Any:
    return 1.0 / (jnp.sqrt(1.0 + shares**2) + shares)


@dataclass(frozen=True)
class DeadZone(Effect):
    """`u' = u - clip(u, -threshold, threshold)`: voltage below the threshold does nothing, above it the threshold is lost."""

    id: ClassVar[str] = "actuator_dead_zone"
    law: ClassVar[str] = "subtractive"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u' = u - clip(u, -threshold, threshold)"
    memoryless: ClassVar[bool] = True

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "threshold", input_unit(robot), 0.03 * robot.scales.input)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("threshold"), tuple(s * seen.largest_input for s in _SHARES))

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        threshold = p[self.key("threshold")]
        return on_drives(robot, inputs, inputs - jnp.clip(inputs, -threshold, threshold))


@dataclass(frozen=True)
class Threshold(DeadZone):
    """`u' = u` above the threshold and nothing below it: no loss once it moves.

    The step at the threshold is `edge` of it wide, more while it is searched for.
    """

    edge: float = _SHARP

    law: ClassVar[str] = "threshold"
    formula: ClassVar[str] = "u' = u where |u| > threshold, else 0"

    @property
    def blurred(self) -> "Threshold":
        return replace(self, edge=0.6)

    @property
    def sharp(self) -> "Threshold":
        return replace(self, edge=_SHARP)

    @property
    def sharper(self) -> "Threshold":
        return replace(self, edge=max(0.25 * self.edge, _SHARP))

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        threshold = self._threshold(inputs, p)
        wide = self.edge * threshold + 1e-9 * robot.scales.input
        passed = jnp.clip((jnp.abs(inputs) - threshold) / wide + 0.5, 0.0, 1.0)
        return on_drives(robot, inputs, inputs * passed)

    def _threshold(self, inputs: Any, p: Numbers) -> Any:
        """What a command has to exceed to pass."""
        return p[self.key("threshold")]


@dataclass(frozen=True)
class GradualDeadZone(DeadZone):
    """What is lost grows with the command up to the threshold: small ones move a little, and nothing begins at an edge."""

    law: ClassVar[str] = "gradual"
    formula: ClassVar[str] = "u' = u - threshold (1 - exp(-|u| / threshold)) sgn u"

    @property
    def freer(self) -> Effect | None:
        return LingeringDeadZone(stands_as=self.stands_as)

    def _left(self, shares: Any, p: Numbers) -> Any:
        """What of the threshold is not lost yet at commands that are so many `shares` of it."""
        return jnp.exp(-shares)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        threshold, size = p[self.key("threshold")], jnp.abs(inputs)
        left = self._left(size / jnp.maximum(threshold, _TINY * size + _NOTHING), p)
        return on_drives(robot, inputs, inputs - threshold * (1.0 - left) * jnp.sign(inputs))


@dataclass(frozen=True)
class HyperbolicDeadZone(GradualDeadZone):
    """The smooth dead zone of a square root: what is left of the threshold falls with the inverse of large commands."""

    law: ClassVar[str] = "hyperbolic"
    formula: ClassVar[str] = "u' = (sqrt(u^2 + threshold^2) - threshold) sgn u"

    @property
    def freer(self) -> Effect | None:
        return LingeringHyperbola(stands_as=self.stands_as)

    def _left(self, shares: Any, p: Numbers) -> Any:
        return _hyperbola(shares)


@dataclass(frozen=True)
class LingeringDeadZone(GradualDeadZone):
    """A share `lingers` of it as by the hyperbola, the rest as by the exponential: for the question whether the robot's own
    parameters, which large commands tell, hang on how soon all of the threshold is lost."""

    law: ClassVar[str] = "lingering"
    restricts: ClassVar[Mapping[str, float]] = MappingProxyType({"lingers": 0.0})
    formula: ClassVar[str] = (
        "u' = u - threshold (1 - (1 - lingers) exp(-x) - lingers (sqrt(1 + x^2) - x)) sgn u, x = |u| / threshold"
    )

    @property
    def freer(self) -> Effect | None:
        return None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        lingers = Parameter(self.restricts["lingers"], "", free=True, lower=-1.0, upper=3.0, typical=0.5, source="form")
        return super().parameters(robot) | {self.key("lingers"): lingers}

    def _left(self, shares: Any, p: Numbers) -> Any:
        lingers = p[self.key("lingers")]
        return (1.0 - lingers) * jnp.exp(-shares) + lingers * _hyperbola(shares)


@dataclass(frozen=True)
class LingeringHyperbola(LingeringDeadZone):
    """The same, as the freer form of the hyperbola."""

    restricts: ClassVar[Mapping[str, float]] = MappingProxyType({"lingers": 1.0})


@dataclass(frozen=True)
class UnequalDeadZone(DeadZone):
    """Subtractive, with one edge for positive and another for negative commands."""

    law: ClassVar[str] = "unequal_edges"
    formula: ClassVar[str] = "u' = u - clip(u, -threshold_backward, threshold_forward)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, typical = input_unit(robot), 0.03 * robot.scales.input
        return positive(self, "threshold_forward", unit, typical) | positive(self, "threshold_backward", unit, typical)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        names = [self.key(f"threshold_{way}") for way in WAYS]
        return tuple(Probe(dict.fromkeys(names, s * seen.largest_input)) for s in _SHARES)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        ahead, back = p[self.key("threshold_forward")], p[self.key("threshold_backward")]
        return on_drives(robot, inputs, inputs - jnp.clip(inputs, -back, ahead))


@dataclass(frozen=True)
class UnequalThresholds(Threshold, UnequalDeadZone):
    """Nothing is lost above a threshold, which is one for positive and another for negative commands."""

    law: ClassVar[str] = "unequal_thresholds"
    formula: ClassVar[str] = "u' = u where u > threshold_forward or u < -threshold_backward, else 0"

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        # From an edge that is far off, nothing leads to where it is.
        names, largest = [self.key(f"threshold_{way}") for way in WAYS], seen.largest_input
        pairs = [(s * a, s * b) for s in _SHARES for a, b in ((1.0, 1.0), (1.0, 0.5), (0.5, 1.0))]
        return tuple(Probe({n: share * largest for n, share in zip(names, pair, strict=True)}) for pair in pairs)

    def _threshold(self, inputs: Any, p: Numbers) -> Any:
        return jnp.where(inputs > 0.0, p[self.key("threshold_forward")], p[self.key("threshold_backward")])


@dataclass(frozen=True)
class DeadZoneOfEach(DeadZone):
    """Subtractive, every motor's driver with a threshold of its own."""

    law: ClassVar[str] = "per_motor"
    formula: ClassVar[str] = "u_i' = u_i - clip(u_i, -threshold_i, threshold_i)"
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in drive_names(robot):
            unit, largest = robot.channels.units.get(name, ""), robot.scales.input_of(name)
            found |= positive(self, f"threshold_{name}", unit, 0.03 * largest)
        return found

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        largest = {self.key(f"threshold_{name}"): robot.scales.input_of(name) for name in drive_names(robot)}
        return tuple(Probe({name: s * own for name, own in largest.items()}) for s in _SHARES)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        threshold = each_drive(robot, lambda name: p[self.key(f"threshold_{name}")])
        return on_drives(robot, inputs, inputs - jnp.clip(inputs, -threshold, threshold))


@dataclass(frozen=True)
class DropOfCurrent(Effect):
    """A voltage that is lost whichever way the current flows: the dead time of a bridge (Jeong & Park, IEEE Transactions on
    Industrial Electronics 38, 1991), the drop of its transistors or diodes, that of brushes. The back-EMF has a say in which
    way that is: a motor that coasts or brakes loses it against the command, and below it no current flows at all."""

    id: ClassVar[str] = "actuator_dead_zone"
    law: ClassVar[str] = "by_current"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u' = back-EMF + x - clip(x, -drop, drop), x = u - back-EMF"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "drop", input_unit(robot), 0.03 * robot.scales.input)

    def refusal(self, robot: Robot) -> str | None:
        if one_torque_each(robot) and torque_falls_with_speed(robot):
            return None
        return (
            f"the drive torques of {robot.name!r} do not fall with its speed, one for every drive input, so that "
            f"{self.title} is a dead zone of the command"
        )

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("drop"), tuple(s * seen.largest_input for s in _SHARES))

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        count = len(robot.channels.inputs)
        none, one = (robot.drive_torques((u,) * count, state, p) for u in (0.0, 1.0))
        most = (p[self.key("drop")] * jnp.abs(b - a) for a, b in zip(none, one, strict=True))
        share = self._share(p)
        return tuple(t - jnp.clip(share * t, -lost, lost) for t, lost in zip(torques, most, strict=True))

    def _share(self, p: Numbers) -> Scalar | float:
        """What of a small driving voltage is lost."""
        return 1.0


@dataclass(frozen=True)
class GradualDropOfCurrent(DropOfCurrent):
    """The same, which grows with the current until all of it is lost: of what drives a small current a `share`."""

    law: ClassVar[str] = "by_current_gradual"
    formula: ClassVar[str] = "u' = back-EMF + x - clip(share x, -drop, drop), x = u - back-EMF"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        share = Parameter(0.7, "", free=True, lower=0.0, upper=1.0, typical=0.5, source="catalogue")
        return super().parameters(robot) | {self.key("share"): share}

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        drop, share = self.key("drop"), self.key("share")
        return tuple(Probe({drop: s * seen.largest_input}, {share: part}) for s in _SHARES for part in (0.3, 0.7))

    def _share(self, p: Numbers) -> Scalar | float:
        return p[self.key("share")]


@dataclass(frozen=True)
class DeadZoneCurve(Curve):
    """What is lost of a command, a curve of its size that goes through zero and has the fixed slope `tail` beyond the reach:
    none, but where it is asked what hangs on that."""

    id: ClassVar[str] = "actuator_dead_zone"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u' = u - lost(|u|) sgn u"
    memoryless: ClassVar[bool] = True
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.1, 0.25, 0.5, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3, 4)
    variable: ClassVar[str] = "|u|"
    reaches: ClassVar[tuple[float, ...]] = (0.25, 0.5, 1.0)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, largest = input_unit(robot), robot.scales.input
        found = self.heights_and_reach(robot, unit, 0.03 * largest, unit, 0.5 * largest)
        return found | {self.key("tail"): Parameter(0.0, "", typical=0.1, source="catalogue")}

    def going_on(self, robot: Robot) -> Robot:
        """`robot` with the curve that goes on beyond its reach as it comes there, on average over the motors: what is lost in
        proportion to the command is another gain of all, so that the robot's own parameters hang on that."""
        numbers, reach = robot.parameters.numbers, robot.parameters[self.key("reach")].value
        last, before = (float(self.mean_at(share * reach, robot, numbers)) for share in (1.0, self.places[-2]))
        return robot.with_values(**{self.key("tail"): (last - before) / ((1.0 - self.places[-2]) * reach)})

    def parts(self, robot: Robot) -> tuple[str, ...]:
        return tuple(drive_names(robot))

    def mean_at(self, x: Any, robot: Robot, p: Numbers) -> Any:
        """The mean of the motors' curves at `x`."""
        return np.mean([np.asarray(self.at(x, p, name)) for name in self.each(robot)], axis=0)

    def agrees(self, robot: Robot) -> bool:
        largest = np.linspace(0.0, robot.scales.input, 101)
        return rises_early(largest, np.asarray(self.mean_at(largest, robot, robot.parameters.numbers)))

    def doubt(self, robot: Robot) -> str:
        """What is lost is lost: on the whole it is more than nothing."""
        sizes = np.linspace(0.0, robot.scales.input, 101)
        lost = np.asarray(self.mean_at(sizes, robot, robot.parameters.numbers))
        return "its curve gives more than is commanded" if np.mean(lost) < 0.0 else ""

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        size = jnp.abs(inputs)
        beyond = jnp.maximum(size - p[self.key("reach")], 0.0)
        lost = jnp.minimum(lost_of_each(self, size, p, robot) + p[self.key("tail")] * beyond, size)
        return on_drives(robot, inputs, inputs - lost * jnp.sign(inputs))


LAWS: tuple[Effect, ...] = (
    DeadZone(),
    Threshold(),
    GradualDeadZone(),
    HyperbolicDeadZone(),
    UnequalDeadZone(),
    UnequalThresholds(),
    DeadZoneOfEach(),
    DropOfCurrent(),
    GradualDropOfCurrent(),
    DeadZoneCurve(),
)
