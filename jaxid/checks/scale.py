"""Pre-flight checks of size: numbers that no robot reaches in SI units, and two columns that contradict each other.

A wrong unit that leaves a column plausible (a speed in knots, a current in decimals of its range) cannot be seen in a log.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..logs.finding import Finding
from ..logs.log import Log
from ..logs.noise import white_level
from .motion import is_planar, response
from .samples import finding
from .windows import excited, speed_windows

Array = NDArray[np.float64]

_RANGE = {
    "m": (1e-6, 1e5),
    "V": (0.02, 500.0),
    "A": (1e-6, 1000.0),
    "N": (1e-4, 1e5),
    "V or N": (1e-4, 5000.0),
    "m/s or rad/s": (2e-3, 30.0),
}
"""What a signal that is not noise usually lies in, by unit."""
_ON_A_FLOOR = {"m/s": (2e-3, 30.0), "rad/s": (2e-3, 40.0)}
"""The same for the body of a robot on a floor: a yaw rate of 40 rad/s is six turns a second."""
_COMMANDED = {"rad": (1e-4, 6.5)}
"""The same for what is commanded: a steering angle of more than a whole turn is most likely in degrees."""
_NEITHER = {"m/s or rad/s": 1e4}
"""What neither of two quantities reaches that a column may hold: small motors turn at thousands of rad/s."""
_ANY = (1e-9, 1e9)
_FEWEST, _FOLLOWS, _NEARLY = 50, 0.7, 0.5
"""Samples, and correlation, from which an angle is what the other commands, and the share of the degrees in a rad by which it
goes farther where it is likely in degrees: a servo does not go all the way."""


def _usual_peak(values: Array) -> float:
    """The size that a tenth of the samples that are not zero exceed, so that a spike does not count; 0 without any."""
    size = np.abs(values[np.isfinite(values)])
    size = size[size > 0]
    return float(np.quantile(size, 0.9)) if len(size) else 0.0


def _units(log: Log) -> Iterator[Finding]:
    driven = {windows.name for windows in speed_windows(log) if excited(windows)}
    for name in (*log.channels.inputs, *log.measured):
        values = log.input(name) if name in log.channels.inputs else log.output(name)
        unit = log.channels.units.get(name, "")
        usual = _RANGE | (_ON_A_FLOOR if is_planar(log) else {}) | (_COMMANDED if name in log.channels.inputs else {})
        least, largest = usual.get(unit, _ANY)
        peak = _usual_peak(values)
        # A speed that was not driven holds nothing but noise, or a simulation's rounding.
        rests = name in log.channels.mixing and name not in driven
        if peak > largest or (0 < peak < least and not rests):
            text = (
                f"{peak:.3g} is usual here, which is {'much' if peak > largest else 'little'} for {unit or 'any unit'}; "
                "map the column with the scale that gives SI units"
            )
            # A column that may hold either of two quantities has no size of its own, up to what neither reaches.
            open_ = " or " in unit and not peak > _NEITHER.get(unit, largest)
            yield finding(log, name, None, "note" if open_ else "warning", "unit", text)


def _contradictions(log: Log) -> Iterator[Finding]:
    """A position whose changes are not the integral of the speed that stands beside it."""
    for name in log.channels.outputs:
        own = log.channels.stand_ins(name)
        if len(own) != 1 or not {name, *own} <= set(log.measured):
            continue
        (substitute,) = own
        speed, position = log.output(name), log.output(substitute)
        width = min(max(1, 2 * response(log)), max(1, len(log) // 10))
        travelled = np.concatenate([[0.0], np.cumsum((speed[:-1] + speed[1:]) / 2 * np.diff(log.time))])
        path = travelled[width::width] - travelled[:-width:width]
        moved = position[width::width] - position[:-width:width]
        both = np.isfinite(path) & np.isfinite(moved)
        path, moved = path[both], moved[both]
        size = max(np.sqrt(np.mean(path**2)), np.sqrt(np.mean(moved**2))) if len(path) > 4 else 0.0
        apart = np.sqrt(np.mean((moved - path) ** 2)) if len(path) > 4 else 0.0
        if apart > 0.3 * size + 5 * white_level(position):
            slope = float(path @ moved / (path @ path)) if path @ path > 0 else np.inf
            text = (
                f"does not change as the integral of {name!r} does (it changes by {slope:.3g} of it); check the units, "
                "signs and clocks of both"
            )
            yield finding(log, substitute, None, "warning", "contradiction", text)


def _in_degrees(log: Log) -> Iterator[Finding]:
    """An angle that goes about as many times as far as the angle that is commanded as a rad has degrees."""
    for name in log.measured:
        for command in log.channels.inputs:
            if not {log.channels.units.get(name), log.channels.units.get(command)} == {"rad"}:
                continue
            own, asked = log.output(name), log.input(command)
            there = np.isfinite(own)
            if there.sum() < _FEWEST:
                continue
            wide, commanded = (np.ptp(np.quantile(x, [0.02, 0.98])) for x in (own[there], asked[there]))
            if not wide * commanded > 0 or np.corrcoef(own[there], asked[there])[0, 1] < _FOLLOWS:
                continue
            ratio = wide / commanded
            for column, factor, other in ((name, ratio, command), (command, 1.0 / ratio, name)):
                if _NEARLY < factor / np.degrees(1.0) < 1.0 / _NEARLY:
                    text = (
                        f"goes {factor:.3g} times as far as {other!r}, about as many as a rad has degrees; if it is in "
                        "degrees, map it with the scale 0.0174533"
                    )
                    yield finding(log, column, None, "warning", "unit", text)


def check_scale(log: Log) -> Iterator[Finding]:
    """Findings about the sizes of the channels, each by itself and those that measure the same motion."""
    doubted = list(_units(log))
    yield from doubted
    said = {found.column for found in doubted}
    yield from (found for found in _in_degrees(log) if found.column not in said)
    yield from _contradictions(log)
