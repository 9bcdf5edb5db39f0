"""What a first look at logs tries of an effect, and what it may ask of the logs for that.

An effect is screened by the change it makes to a simulation. Parameters that scale it (strengths) enter by one probe each;
those that say where or when it acts (shapes) are tried over a grid, and strengths beyond which an effect is not proportional
(a limit, a dead zone, a delay) at several sizes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from ..parameters import Parameter

_STEP = 0.05
"""Share of its value by which a robot's own parameter is moved in a first look."""


@dataclass(frozen=True)
class Probe:
    """Changes that explain together: each of `strengths` is applied on its own while `shape` holds.

    `limits` is where the inverse of each strength that cuts signals off would begin to do so. `out_of` is how many shapes were
    looked at for this one to be found.
    """

    strengths: Mapping[str, float]
    shape: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, float] = field(default_factory=dict)
    out_of: int = 1


@dataclass(frozen=True)
class Seen:
    """What the logs at hand show, for effects that ask where to look; what takes work is worked out when it is asked for.

    - `largest_input`: the largest magnitude of any input.
    - `duration`: of the longest log [s].
    - `path()`: places that the robot drove through [N, 2], by dead reckoning; None where they are not known.
    - `periods(by_torque)`: numbers of periods a unit of the wheels' angles at which the missing force repeats, or what it is in
      proportion to the drive torque, and how many were looked at.
    """

    largest_input: float
    duration: float
    path: Callable[[], Float[np.ndarray, "N 2"] | None]
    periods: Callable[[bool], tuple[tuple[float, ...], int]]


def one_by_one(name: str, sizes: tuple[float, ...]) -> tuple[Probe, ...]:
    """A strength that the effect is not proportional to, at several sizes."""
    return tuple(Probe({name: size}) for size in sizes)


def moved(own: Parameter) -> float:
    """A value of one of the robot's own parameters to be tried: a little off the one it has, or, where that is zero, what is
    typical. Of one that nobody knows a size of, a share or a length that is small: one would be a wheel of no radius."""
    return own.value + (_STEP * abs(own.value) or own.typical or _STEP)
