"""A wrong scale of a sensor."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import shape, signed
from .outputs import each_channel, sensed

_OTHER_UNIT = 0.5
"""Error of a scale beyond which a sensor reads in another unit."""

_BLIND = 0.9
"""What a sensor would have to lose of one way to show nothing of it."""


@dataclass(frozen=True)
class SensorScale(Effect):
    """A wrong scale on every measured speed, and on every position: another number of counts in a turn than was told."""

    id: ClassVar[str] = "sensor_scale"
    law: ClassVar[str] = "each_channel"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y' = (1 + error) y"
    otherwise: ClassVar[str] = (
        "a length that the model has built in wrongly, such as a wheel's radius or a lever, or a unit"
    )

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in sensed(robot):
            found |= signed(self, f"error_{name}", "", 0.03)
        return found

    def may_hold(self, robot: Robot) -> list[str]:
        """The error in the middle of all, of two the smaller one: what all sensors read too much may be a constant's of the
        robot, such as its mass. Where one is held, the same of all that have another unit: what all currents read too much is
        another resistance, whatever the speeds read."""
        free = {name: robot.parameters[name].free for name in self.either_nominal(robot)}
        if all(free.values()):
            return self._middle(list(free), robot)
        units: dict[str, list[str]] = {}
        for channel in sensed(robot):
            units.setdefault(robot.channels.units.get(channel, ""), []).append(self.key(f"error_{channel}"))
        return [name for own in units.values() if all(map(free.get, own)) for name in self._middle(own, robot)]

    def _middle(self, names: list[str], robot: Robot) -> list[str]:
        # What no log measures is where it was.
        values = {name: robot.parameters[name].value for name in names if robot.parameters[name].value != 0.0}
        if len(names) < 2 or len(values) < 2:
            return sorted(values) if len(names) > 1 else []
        if len(values) == 2:
            return [min(values, key=lambda name: abs(values[name]))]
        return sorted(values, key=lambda name: values[name])[(len(values) - 1) // 2 :][:1]

    def either_nominal(self, robot: Robot) -> dict[str, str]:
        return {self.key(f"error_{name}"): f"{name} is to scale" for name in sensed(robot)}

    def doubt(self, robot: Robot) -> str:
        """One sensor may read in another unit; where all do, it is the robot that is another, and the sensors stand for what
        it lacks."""
        errors = {name: robot.parameters[self.key(f"error_{name}")].value for name in sensed(robot)}
        errors = {name: error for name, error in errors.items() if error != 0.0}  # others are not measured
        if len(errors) < 2 or min(map(abs, errors.values())) <= _OTHER_UNIT:
            return ""
        times = " and ".join(f"{name} ({1.0 + error:.3g} times)" for name, error in errors.items())
        return f"{times} would all be in another unit, and the robot's own parameters with them; map the columns if they are"

    def doubt_of_change(self, robot: Robot) -> str:
        """One sensor may have been exchanged, or its wheel; where all show another scale at once it is rather the robot."""
        names = sensed(robot)
        errors = [robot.parameters[self.key(f"error_{name}")].value for name in names]
        if len(errors) < 2 or not all(errors):
            return ""
        return (
            f"{' and '.join(names)} would all have another scale at once, which is what a change of what drives the robot does "
            "together with changes of its load and friction"
        )

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        return outputs * (1.0 + each_channel(self, p, "error", robot))


@dataclass(frozen=True)
class ScaleByDirection(SensorScale):
    """Another scale for positive readings of a speed than for negative ones."""

    law: ClassVar[str] = "by_direction"
    formula: ClassVar[str] = "y' = (1 + error) y where y > 0, (1 + error_backward) y where y < 0"
    otherwise: ClassVar[str] = ""

    def may_hold(self, robot: Robot) -> list[str]:
        return []

    def either_nominal(self, robot: Robot) -> dict[str, str]:
        return {}

    def doubt(self, robot: Robot) -> str:
        table = robot.parameters
        both = {
            name: (table[self.key(f"error_{name}")], table[self.key(f"error_backward_{name}")])
            for name in robot.channels.outputs
        }
        blind = [name for name, own in both.items() if min(p.value for p in own) < -_BLIND]
        if blind:
            return f"{' and '.join(blind)} would show nothing of what goes one way, or that it goes the other; no scale does"
        other = [name for name, own in both.items() if min(abs(p.value) for p in own) > _OTHER_UNIT]
        times = " and ".join(f"{name} ({1.0 + both[name][0].value:.3g} times)" for name in other)
        return f"{times} would be in another unit for either way; map the columns if they are" if other else ""

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in robot.channels.outputs:
            found |= signed(self, f"error_{name}", "", 0.03) | signed(self, f"error_backward_{name}", "", 0.03)
        return found

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        ahead, back = each_channel(self, p, "error", robot), each_channel(self, p, "error_backward", robot)
        return outputs * (1.0 + jnp.where(outputs > 0, ahead, back))


@dataclass(frozen=True)
class ScaleCurves(Curve):
    """Every output's error of scale, a curve of the size of what it measures."""

    id: ClassVar[str] = "sensor_scale"
    where: ClassVar[str] = "sensor"
    formula: ClassVar[str] = "y_i' = y_i (1 + error_i(|y_i| / amplitude_i))"
    knots: ClassVar[tuple[float, ...]] = (0.1, 0.4, 0.9)
    free: ClassVar[tuple[int, ...]] = (0, 1, 2)
    variable: ClassVar[str] = "share of the channel's amplitude"
    settled_by_holding: ClassVar[bool] = True
    reaches: ClassVar[tuple[float, ...]] = (1.0, 1.6)  # what a sensor compresses goes beyond what it shows

    def each(self, robot: Robot) -> tuple[str, ...]:
        return robot.channels.outputs

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found = self.heights_and_reach(robot, "", 0.03, "", 1.0)
        for name in self.each(robot):
            found |= shape(
                self, f"amplitude_{name}", robot.channels.units.get(name, ""), robot.scales.output(name), free=False
            )
        return found

    def may_be_none(self, robot: Robot) -> list[tuple[list[str], dict[str, float]]]:
        """For every channel of which all heights are estimated beside others: its heights, which may all be zero, and the free
        ones of the others in proportion. What all channels show too much of is as well the robot's own parameters'."""
        table, found = robot.parameters, list[tuple[list[str], dict[str, float]]]()
        each = {name: [self.height(k, name) for k in self.varying] for name in self.each(robot)}
        free = [name for name, own in each.items() if all(table[height].free for height in own)]
        for name in free if len(free) > 1 else ():
            scale = 1.0 + float(np.median([table[height].value for height in each[name]]))
            others = [height for other in each if other != name for height in each[other] if table[height].free]
            if scale > 0.0:
                found.append((each[name], {height: (1.0 + table[height].value) / scale - 1.0 for height in others}))
        return found

    def doubt(self, robot: Robot) -> str:
        """A sensor shows more of more: a curve by which it does not stands for something that depends on the output, too. And
        what shows half as much again of everything has another unit, which is no curve."""
        heights = {
            name: [robot.parameters[self.height(k, name)].value for k in self.varying] for name in self.each(robot)
        }
        other = [name for name, own in heights.items() if min(map(abs, own)) > _OTHER_UNIT]
        if other:
            return f"{' and '.join(other)} would be in another unit, by a curve, and the robot's own parameters with it"
        numbers, shares = robot.parameters.numbers, np.linspace(0.0, 1.0, 201)
        names = [
            name
            for name in self.each(robot)
            if np.any(np.diff(shares * (1.0 + np.asarray(self.at(shares, numbers, name)))) < 0.0)
        ]
        return f"by its curve {' and '.join(names)} would show less of more" if names else ""

    def measure(self, outputs, time, p: Numbers, robot: Robot):
        columns = [outputs[:, i] for i in range(outputs.shape[1])]
        for i, name in enumerate(self.each(robot)):
            share = jnp.abs(columns[i]) / p[self.key(f"amplitude_{name}")]
            columns[i] = columns[i] * (1.0 + self.at(share, p, name))
        return jnp.stack(columns, axis=1)


LAWS: tuple[Effect, ...] = (SensorScale(), ScaleByDirection(), ScaleCurves())
