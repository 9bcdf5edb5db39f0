"""The unit of length that a robot's numbers are in, where they are not in metres."""

import re

_METRES = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "km": 1e3}
_PREFIXES = {"": 1.0, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6}
_MASSES = {"kg": 1.0, "g": 1e-3, "mg": 1e-6, "t": 1e3}


def accelerated(force: str, mass: str) -> str:
    """The length that a `force` accelerates a `mass` by, per second squared, as their units say it: mm of mN and kg, or of
    g mm/s^2; m where they do not say."""
    written = re.search(r"(?<![A-Za-z])(mm|cm|um|km|m)(?:/s\^?2|/s²| s\^?-2)", force)
    if written:
        return written[1]
    newtons = re.fullmatch(r"([uµmkM]?)N", force.strip())
    if newtons is None or mass not in _MASSES:
        return "m"
    metres = _PREFIXES[newtons[1]] / _MASSES[mass]
    return next((unit for unit, long in _METRES.items() if abs(metres / long - 1.0) < 1e-9), "m")
