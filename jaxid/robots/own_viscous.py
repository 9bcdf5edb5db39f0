"""How many times the viscous friction that a user's robot declares its dynamics have: where a coefficient is in N s/m and the
speed in mm/s, a thousandth, by which effects on it would be other effects."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._float64 import in_float64
from ..parameters import ParameterError

_MOST_ROBOTS = 256
_SAME = 0.01
"""How far the two may be apart, as a share: what rounding of constants makes."""


@dataclass(frozen=True)
class ViscousFriction:
    """Of which axes it is asked: `named` are axis and parameter in the order of the robot's axes, "" for none. `functions` tell
    robots apart, whose numbers do not count."""

    functions: Hashable
    states: tuple[str, ...]
    parameters: tuple[str, ...]
    named: tuple[tuple[str, str], ...]
    robot: Any = field(compare=False, repr=False)


def _times(own: ViscousFriction, axis: int) -> float:
    """How many times the force that is declared the dynamics have: not a number where no one number says it (a parameter
    that is at work elsewhere too), or where they cannot be asked."""
    robot = replace(own.robot, effects=()) if own.robot.effects else own.robot
    parameter = own.named[axis][1]
    rng = np.random.default_rng(2)
    free, unit = (0.0,) * len(own.named), tuple(float(k == axis) for k in range(len(own.named)))

    def drawn(names: Sequence[str]) -> dict[str, np.float64]:
        return dict(zip(names, rng.uniform(0.3, 1.0, len(names)), strict=True))

    def rates(state, inputs, p, resisting) -> NDArray[np.float64]:
        found = robot.motion(state, inputs, (), resisting, (0.0,) * len(robot.velocities), p)
        return np.array([float(found[name]) for name in own.states])

    declared, there = [], []
    for _ in range(3):
        state, p = drawn(own.states), drawn(own.parameters)
        inputs = tuple(drawn(robot.own_channels.inputs).values())
        with np.errstate(all="ignore"):
            plain = rates(state, inputs, p, free)
            # Differences are exact: both forces enter linearly, or no one number says how many times.
            declared.append(float(robot.rubbing(state, p)[axis]) * (rates(state, inputs, p, unit) - plain))
            there.append(rates(state, inputs, {**p, parameter: p[parameter] + 1.0}, free) - plain)
    wanted, found = np.ravel(declared), np.ravel(there)
    if not (np.isfinite(wanted).all() and np.isfinite(found).all() and wanted.any()):
        return float("nan")
    times = float(wanted @ found / (wanted @ wanted))
    left = np.linalg.norm(found - times * wanted)
    return times if left <= 1e-6 * np.linalg.norm(found) else float("nan")


@lru_cache(_MOST_ROBOTS)
def _every(own: ViscousFriction) -> tuple[float, ...]:
    found = []
    for k, (axis, parameter) in enumerate(own.named):
        times = _times(own, k) if parameter else float("nan")
        if times <= 0.0:
            has = f"{times:.4g} times that force" if times else "no such force"
            raise ParameterError(
                f"axis {axis!r}: viscous={parameter!r} says that {parameter} times the axis' speed resists it, and the "
                f"dynamics have {has}; let them have it, or leave `viscous` out"
            )
        found.append(times if np.isfinite(times) and abs(times - 1.0) > _SAME else 1.0)
    return tuple(found)


@in_float64
def viscous_times(own: ViscousFriction) -> tuple[float, ...]:
    """How many times coefficient and speed the dynamics have for each axis: one where no one number says it.

    Raises `ParameterError` where they have no such force, or one that drives.
    """
    return _every(own) if any(parameter for _, parameter in own.named) else (1.0,) * len(own.named)
