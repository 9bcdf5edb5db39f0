"""A load that is not the same all the time: there in some logs, taken up or dropped at some moment of a log, leaking. What else
differs between two sets of logs is for `jaxid.explain_change` to say."""

from dataclasses import dataclass, replace
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import shape, signed
from ..in_some_logs import InSomeLogs

_MOMENTS = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9)
"""Moments that are tried, in shares of a log."""
_TIMES = (0.5, 1.0, 2.0)
"""Times after which a leaking load is gone that are tried, in shares of a log."""


def loaded(effect: Effect, robot: Robot) -> tuple[str, str]:
    """The robot's mass and, where it has one, its inertia against turning, as it says what a load changes."""
    mass, *others = robot.mechanisms[effect.id]
    return mass, others[0] if others else ""


@dataclass(frozen=True)
class _Load(Effect):
    """Mass, and inertia where the robot turns, that depend on the time since the start of each log."""

    id: ClassVar[str] = "payload_change"
    where: ClassVar[str] = "body"
    needs: ClassVar[tuple[str, ...]] = ("mechanism",)

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return (self.own("time_under_way"),)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        mass, inertia = loaded(self, robot)
        found: dict[str, Parameter] = {}
        for name, of in (("mass", mass), ("inertia", inertia)):
            if of:
                found |= signed(self, name, robot.parameters[of].unit, 0.1 * abs(robot.parameters[of].value) or 1.0)
        return found

    def strengths(self, robot: Robot) -> dict[str, float]:
        """Typical sizes of what is added."""
        return {name: p.typical or 1.0 for name, p in _Load.parameters(self, robot).items()}

    def there(self, time: Scalar, p: Numbers) -> Scalar:
        """The share of the load that there is at a time [s]."""
        raise NotImplementedError

    def share(self, state: State, p: Numbers) -> Scalar:
        """The share of the load that there is in a state."""
        return self.there(state[self.own("time_under_way")], p)

    def numbers(self, p: Numbers, state: State, robot: Robot) -> Numbers:
        share, changed = self.share(state, p), dict(p)
        for name, of in zip(("mass", "inertia"), loaded(self, robot), strict=True):
            if of:
                changed[of] = p[of] + share * p[self.key(name)]
        return changed

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        return {self.own("time_under_way"): 1.0}

    def doubt(self, robot: Robot) -> str:
        """What no robot can lose: all of its own mass."""
        name, table = loaded(self, robot)[0], robot.parameters
        own, load = table[name].value, table[self.key("mass")].value
        if own + load > 0.0:
            return ""
        unit = f" {table[name].unit}".rstrip()
        return f"of a robot of {name} {own:.3g}{unit} no load of {load:.3g}{unit} is left"


@dataclass(frozen=True)
class LoadInSomeLogs(InSomeLogs, _Load):
    """A load that is there throughout the logs whose column `payload` is 1."""

    formula: ClassVar[str] = "M' = M + mass, J' = J + inertia where the log's payload is 1"
    from_columns: ClassVar[tuple[str, ...]] = ("payload",)

    def share(self, state: State, p: Numbers) -> Scalar:
        return self.here(state)


@dataclass(frozen=True)
class FromAMoment(_Load):
    """A load that is there from some moment of each log on; a negative one is dropped.

    The fixed `width` is the time that this takes, `edge` times as long while it is searched for.
    """

    edge: float = 1.0

    since_start: ClassVar[bool] = True
    law: ClassVar[str] = "from_a_moment"
    formula: ClassVar[str] = "M' = M + mass, J' = J + inertia where t > moment"

    @property
    def blurred(self) -> "FromAMoment":
        return replace(self, edge=10.0)

    @property
    def sharp(self) -> "FromAMoment":
        return replace(self, edge=1.0)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        moment = shape(self, "moment", "s", 0.5 * robot.scales.duration)
        return super().parameters(robot) | moment | shape(self, "width", "s", robot.scales.interval, free=False)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        moments = [share * robot.scales.duration for share in _MOMENTS]
        return tuple(Probe(self.strengths(robot), {self.key("moment"): t}, out_of=len(moments)) for t in moments)

    def there(self, time: Scalar, p: Numbers) -> Scalar:
        return 0.5 * (1.0 + jnp.tanh((time - p[self.key("moment")]) / (self.edge * p[self.key("width")])))


@dataclass(frozen=True)
class Leaking(_Load):
    """A load that is lost at a steady rate and gone after `time`."""

    since_start: ClassVar[bool] = True
    law: ClassVar[str] = "leaking"
    formula: ClassVar[str] = "M' = M + mass max(0, 1 - t / time), J' = J + inertia max(0, 1 - t / time)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return super().parameters(robot) | shape(self, "time", "s", robot.scales.duration)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        times = [share * robot.scales.duration for share in _TIMES]
        return tuple(Probe(self.strengths(robot), {self.key("time"): t}, out_of=len(times)) for t in times)

    def there(self, time: Scalar, p: Numbers) -> Scalar:
        return jnp.maximum(0.0, 1.0 - time / p[self.key("time")])


@dataclass(frozen=True)
class LoadCurve(Curve):
    """The mass beyond that at the start of each log, a curve of the time."""

    since_start: ClassVar[bool] = True
    id: ClassVar[str] = "payload_change"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "M' = M + load(t)"
    needs: ClassVar[tuple[str, ...]] = ("mechanism",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.25, 0.5, 0.75, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3, 4)
    variable: ClassVar[str] = "time"
    wanders: ClassVar[bool] = True

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return (self.own("time_under_way"),)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        mass = robot.parameters[loaded(self, robot)[0]]
        return self.heights_and_reach(robot, mass.unit, 0.1 * abs(mass.value) or 1.0, "s", robot.scales.duration)

    def numbers(self, p: Numbers, state: State, robot: Robot) -> Numbers:
        mass = loaded(self, robot)[0]
        return {**p, mass: p[mass] + self.at(state[self.own("time_under_way")], p)}

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        return {self.own("time_under_way"): 1.0}


LAWS: tuple[Effect, ...] = (FromAMoment(), LoadInSomeLogs(), Leaking(), LoadCurve())
