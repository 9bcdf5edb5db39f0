"""The wheels of a robot's two sides in a recording, where the speeds of its body are not there themselves.

With the radius R of the wheels and half the track b, wheels that turn at w_r and w_l move the body by
v = R (w_r + w_l) / 2 and turn it by w = R (w_r - w_l) / (2 b).
"""

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from .series import Series
from .units import Unit, unit_in_name

LETTERS = tuple("deinqsuvw")
"""Before r and l of a side: a duty, a speed, an encoder, a current, a voltage … (ur and ul, vr and vl)."""
_OTHER_SIDE = {f"{letter}r": f"{letter}l" for letter in LETTERS} | {
    "r": "l", "rr": "rl", "fr": "fl", "rh": "lh", "rw": "lw", "rm": "lm",
    "rechts": "links", "rechte": "linke", "rechter": "linker", "rechtes": "linkes", "droite": "gauche", "droit": "gauche",
    "derecha": "izquierda", "derecho": "izquierdo", "destra": "sinistra", "destro": "sinistro",
}  # fmt: skip
_HINTS: Mapping[str, tuple[str, str, str]] = {
    "m/s": ("R / 2", "R / 2", "R the wheels' radius [m]"),
    "rad/s": ("R / (2 b)", "-R / (2 b)", "R the wheels' radius and b half the track [m]"),
}
_OF_RIMS: Mapping[str, tuple[str, str, str]] = {
    "m/s": ("1 / 2", "1 / 2", ""),
    "rad/s": ("1 / (2 b)", "-1 / (2 b)", "b half the track [m]"),
}
"""Where the speeds are those of the wheels' rims already."""


_ENCODERS = {"enc", "encoder", "encoders"}
_POSITIONS = {"pos", "position", "angle", "phi", "rotation"}
_RATES = {"vel", "velocity", "speed", "rate", "rpm"}


def unit_of(series: Series) -> Unit:
    """What a signal's numbers are in: as its format says, else as its name does, else nothing."""
    if series.unit or series.said:
        return Unit(series.unit, series.to_si, series.said)
    return unit_in_name(series.name) or Unit("", 1.0, "")


class WheelPair(NamedTuple):
    """Fields of a right and a left wheel, whether they are positions, and in what unit."""

    right: str
    left: str
    positions: bool
    counts: bool
    unit: Unit = Unit("", 1.0, "")

    def hint(self, channel: str, unit: str) -> str:
        """A line of a mapping, with letters where only the robot's owner knows the number; empty for another unit."""
        if unit not in _HINTS:
            return ""
        right, left, letters = (_OF_RIMS if self.unit.si == "m/s" else _HINTS)[unit]
        if self.counts:
            letters += ", times 2 pi / counts per turn"
        elif self.unit.factor != 1.0:
            letters = f"{letters}, times" if letters else "times"
            letters += f" {self.unit.factor:.9g}, since they are in {self.unit.said}"
        rate = ", derivative = true" if self.positions else ""
        line = f'{channel} = {{ fields = {{ "{self.right}" = {right}, "{self.left}" = {left} }}{rate} }}'
        return f"{line}   # {letters}" if letters else line


def _of_the_left(name: str) -> str:
    """The name that the left side's field has, of the right side's; empty for a field of no side."""
    whole = re.sub("right", lambda found: _as_written("left", found[0]), name, flags=re.IGNORECASE)
    if whole != name:
        return whole
    parts = re.split(r"([^A-Za-z]+)", name)
    swapped = [_as_written(_OTHER_SIDE.get(part.lower(), part), part) for part in parts]
    return "".join(swapped) if swapped != parts else ""


def _as_written(word: str, like: str) -> str:
    """A word with the capitals of another."""
    return word.upper() if like.isupper() else word.capitalize() if like[:1].isupper() else word


def _without_unit(name: str) -> str:
    """The name without a unit in brackets at its end."""
    bare = re.sub(r"\s*[\[(][^\])]*[\])]\s*$", "", name)
    return bare if unit_in_name(name) is not None and unit_in_name(bare) is None else name


def of_one_side(names: Iterable[str]) -> set[str]:
    """The names of which there is another one for the other side, whatever units stand in brackets behind them."""
    bare = {name: _without_unit(name) for name in names}
    there = set(bare.values())
    rights = {name: left for name in there if (left := _of_the_left(name)) in there}
    both = {*rights, *rights.values()}
    return {name for name, one in bare.items() if one in both}


def _named_position(series: Series) -> tuple[bool, bool]:
    """Whether a field is the position of something that turns, and whether in counts of an encoder, as its name says."""
    named, words = unit_in_name(series.name), set(re.findall(r"[a-z]+", series.name.lower()))
    rates = bool(words & _RATES)
    if named is not None and named.said == "counts":
        return not rates, not rates
    whole = bool(np.all(series.values == np.round(series.values)))
    if words & _ENCODERS and whole and not rates:
        return True, True
    turns = named is not None and "rad" in named.si.split(" or ")
    return turns and bool(words & _POSITIONS) and not rates, False


def _kind(series: Series) -> int | None:
    """0 for speeds of wheels, 1 for angles, 2 for counts; None for what is none of these."""
    unit = series.unit.split(" or ")
    position, counts = _named_position(series) if not series.unit else ("rad" in unit, False)
    speed = "rad/s" in unit or (not position and unit_of(series).si in ("rad/s", "m/s"))
    return 0 if speed else 2 if counts else 1 if position else None


def _moving(series: Iterable[Series]) -> dict[str, Series]:
    return {one.name: one for one in series if not one.fault and len(one) > 1 and np.ptp(one.values) > 0}


def _pairs(usable: Mapping[str, Series]) -> list[tuple[int, WheelPair]]:
    found = []
    for name, one in usable.items():
        left, kind = _of_the_left(name), _kind(one)
        if left in usable and kind is not None:
            found.append((kind, WheelPair(name, left, kind > 0, kind == 2, unit_of(one))))
    return found


def wheel_pair(series: Iterable[Series]) -> WheelPair | None:
    """The wheels of both sides, speeds rather than positions rather than counts; None where there are none."""
    found = _pairs(_moving(series))
    return min(found, key=lambda pair: pair[0])[1] if found else None


def wheel_positions(series: Iterable[Series], count: int) -> tuple[str, ...]:
    """The fields that are the positions of `count` wheels: a right and a left one, or as many that are told apart by a number,
    in its order; empty where there are none."""
    usable = _moving(series)
    if count == 2:
        found = [(kind, pair) for kind, pair in _pairs(usable) if kind > 0]
        best = min(found, key=lambda pair: pair[0])[1] if found else None
        return () if best is None else (best.right, best.left)
    groups: dict[str, list[tuple[int, str]]] = {}
    for name, one in usable.items():
        number = re.search(r"\d+(?=\D*$)", name)
        if number and _kind(one) in (1, 2):
            groups.setdefault(name[: number.start()] + name[number.end() :], []).append((int(number[0]), name))
    return next((tuple(n for _, n in sorted(group)) for group in groups.values() if len(group) == count), ())
