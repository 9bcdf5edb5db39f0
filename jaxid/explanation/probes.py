"""Which values of an effect's parameters a first look tries.

An effect is screened by the change it makes to the simulation. Parameters that scale an effect (strengths) enter by one
probe each; those that say where or when it acts (shapes) are tried over a grid, and strengths beyond which an effect is
not proportional (a limit, a dead zone, a delay) at several sizes.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..logs import LogSet
from ..robots.effect import Effect
from ..robots.robot import Robot
from ..robots.scales import Scales
from .conditions import motions
from .ripple_periods import Periods


@dataclass(frozen=True)
class Group:
    """Columns that explain together: `shape` holds while each of `strengths` is applied on its own.

    `limit` is where the inverse of a strength that cuts signals off would begin to do so. `out_of` is how many shapes were
    looked at for this one to be found.
    """

    effect: Effect
    shape: Mapping[str, float]
    strengths: Mapping[str, float]
    limit: float | None = None
    out_of: int = 1


def _largest(logs: LogSet) -> float:
    return max(float(np.max(np.abs(log.inputs))) for log in logs)


def _lines(robot: Robot, logs: LogSet) -> list[dict[str, float]]:
    """Lines across the floor that part of the driven path lies beyond."""
    path = np.concatenate([motion.path for motion in motions(robot, logs) if motion.path is not None])
    lines = []
    for angle in np.arange(8) * np.pi / 4:
        along = path @ np.array([np.cos(angle), np.sin(angle)])
        for offset in np.quantile(along, [0.3, 0.5, 0.7, 0.85]):
            lines.append({"angle": float(angle), "offset": float(offset)})
    return lines


_SHARES = (0.09, 0.14, 0.21, 0.3, 0.43, 0.6, 0.86, 1.2)
"""Limits of traction that are tried, in shares of the drive force at the largest input."""


def _times(scales: Scales) -> tuple[float, ...]:
    """Delays and time constants that are tried: from half a sample to what the robot's own time constant would hide."""
    first, last = 0.5 * scales.interval, max(0.4 * scales.time, 4.0 * scales.interval)
    return first, float(np.sqrt(first * last)), last


def groups(effect: Effect, robot: Robot, logs: LogSet, repeating: Periods) -> list[Group]:
    """The probes of one effect on `robot` (which already carries it), for these logs; `repeating` are the periods at which
    the missing force repeats."""
    own = [name for name in robot.parameters if name.startswith(f"{effect.id}.")] + list(effect.frees(robot))
    typical = {name: robot.parameters[name].typical or 1.0 for name in own}
    key, scales, times = effect.key, robot.scales, _times(robot.scales)
    one_by_one: dict[str, tuple[str, tuple[float, ...]]] = {
        "actuator_dead_zone": ("threshold", tuple(s * _largest(logs) for s in (0.01, 0.03, 0.08, 0.2, 0.4))),
        "motor_lag": ("time_constant", times),
        "input_delay": ("delay", times),
        "sensor_lag": ("time_constant", times),
        "sensor_delay": ("delay", times),
    }
    if effect.id in one_by_one:
        name, values = one_by_one[effect.id]
        return [Group(effect, {}, {key(name): value}) for value in values]
    if effect.id == "voltage_saturation":
        largest, shares = _largest(logs), (0.98, 0.93, 0.85, 0.7, 0.55)
        return [Group(effect, {}, {key("inverse_limit"): 1 / (s * largest)}, largest) for s in shares]
    if effect.id == "traction_limit":
        forces = [share * scales.force for share in _SHARES]
        return [Group(effect, {}, {key("inverse_limit"): 1 / force}, 1.2 * force) for force in forces]
    if effect.id == "stribeck_friction":
        return [
            Group(effect, {key("speed"): speed}, {key("amplitude"): typical[key("amplitude")]})
            for speed in (0.02 * scales.speed, 0.05 * scales.speed, 0.12 * scales.speed)
        ]
    if effect.id == "cogging_torque":
        strengths = {name: typical[name] for name in own if not name.endswith("periods")}
        return [Group(effect, {key("periods"): n}, strengths, out_of=repeating.looked_at) for n in repeating.values]
    if effect.id == "surface_change":
        strengths = {key("coulomb"): 0.3, key("viscous"): 0.3}
        lines = _lines(robot, logs)
        return [Group(effect, {key(n): v for n, v in line.items()}, strengths, out_of=len(lines)) for line in lines]
    strengths = {name: typical[name] for name in own}
    return [Group(effect, {}, strengths)] if strengths else []


def lanes(found: list[Group]) -> tuple[list[dict[str, float]], list[list[int]]]:
    """Parameter changes, one a simulation, and for every group the simulations that are its columns."""
    changes: list[dict[str, float]] = []
    columns: list[list[int]] = []
    counter = itertools.count()
    for group in found:
        mine = []
        for name, value in group.strengths.items():
            changes.append({**group.shape, name: value})
            mine.append(next(counter))
        columns.append(mine)
    return changes, columns
