"""The wheels of a robot's two sides in a recording, where the speeds of its body are not there themselves.

With the radius R of the wheels and half the track b, wheels that turn at w_r and w_l move the body by
v = R (w_r + w_l) / 2 and turn it by w = R (w_r - w_l) / (2 b).
"""

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from .series import Series
from .units import unit_in_name

_OTHER_SIDE = {"right": "left", "r": "l", "rr": "rl", "fr": "fl", "rh": "lh"}
_HINTS: Mapping[str, tuple[str, str, str]] = {
    "m/s": ("R / 2", "R / 2", "R the wheels' radius [m]"),
    "rad/s": ("R / (2 b)", "-R / (2 b)", "R the wheels' radius and b half the track [m]"),
}


class WheelPair(NamedTuple):
    """Fields of a right and a left wheel, and whether they are positions."""

    right: str
    left: str
    positions: bool
    counts: bool

    def hint(self, channel: str, unit: str) -> str:
        """A line of a mapping, with letters where only the robot's owner knows the number; empty for another unit."""
        if unit not in _HINTS:
            return ""
        right, left, letters = _HINTS[unit]
        if self.counts:
            letters += ", times 2 pi / counts per turn"
        rate = ", derivative = true" if self.positions else ""
        return f'{channel} = {{ fields = {{ "{self.right}" = {right}, "{self.left}" = {left} }}{rate} }}   # {letters}'


def _of_the_left(name: str) -> str:
    """The name that the left side's field has, of the right side's; empty for a field of no side."""
    parts = re.split(r"([^A-Za-z]+)", name)
    swapped = [_OTHER_SIDE.get(part, part) for part in parts]
    return "".join(swapped) if swapped != parts else ""


def of_one_side(names: Iterable[str]) -> set[str]:
    """The names of which there is another one for the other side."""
    there = set(names)
    rights = {name: left for name in there if (left := _of_the_left(name)) in there}
    return {*rights, *rights.values()}


def wheel_pair(series: Iterable[Series]) -> WheelPair | None:
    """The wheels of both sides, speeds rather than positions rather than counts; None where there are none."""
    usable = {one.name: one for one in series if not one.fault and len(one) > 1 and np.ptp(one.values) > 0}
    found: list[tuple[int, WheelPair]] = []
    for name, one in usable.items():
        left = _of_the_left(name)
        if left not in usable:
            continue
        unit = one.unit.split(" or ")
        named = unit_in_name(name)
        counts = not one.unit and named is not None and named.said == "counts"
        if "rad/s" in unit or counts or "rad" in unit:
            place = 0 if "rad/s" in unit else 2 if counts else 1
            found.append((place, WheelPair(name, left, place > 0, counts)))
    return min(found, key=lambda pair: pair[0])[1] if found else None
