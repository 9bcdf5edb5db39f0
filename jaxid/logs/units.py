"""Units as files and people write them: which SI unit is meant, and by which factor numbers come to it.

A format's own words (`Rotation per Second`, `deg/s`) are read whole; in a name (`/gyro_dps`, `left_mv`, `wheelSpeedRpm`) only
words that nobody uses for anything else count, so that the letter m of a topic is no metre.
"""

import json
import math
import re
from typing import NamedTuple

_TURN, _DEGREE = 2.0 * math.pi, math.pi / 180.0

_LENGTHS = {
    "mm": 1e-3, "millimeter": 1e-3, "millimetre": 1e-3, "cm": 1e-2, "centimeter": 1e-2, "centimetre": 1e-2,
    "km": 1e3, "kilometer": 1e3, "kilometre": 1e3, "meter": 1.0, "metre": 1.0,
    "inch": 0.0254, "inche": 0.0254, "foot": 0.3048, "feet": 0.3048, "ft": 0.3048,
}  # fmt: skip
_ANGLES = {
    "deg": _DEGREE, "degree": _DEGREE, "rad": 1.0, "radian": 1.0, "mrad": 1e-3, "milliradian": 1e-3,
    "rev": _TURN, "revolution": _TURN,
}  # fmt: skip
_OTHERS = {
    "mv": ("V", 1e-3), "millivolt": ("V", 1e-3), "volt": ("V", 1.0), "voltage": ("V", 1.0),
    "ma": ("A", 1e-3), "milliamp": ("A", 1e-3), "milliampere": ("A", 1e-3), "amp": ("A", 1.0), "ampere": ("A", 1.0),
    "newton": ("N", 1.0), "dp": ("rad/s", _DEGREE), "rpm": ("rad/s", _TURN / 60.0), "radp": ("rad/s", 1.0),
    "krpm": ("rad/s", 1e3 * _TURN / 60.0), "rp": ("rad/s", _TURN), "revp": ("rad/s", _TURN), "degp": ("rad/s", _DEGREE),
    "mp": ("m/s", 1.0), "mmp": ("m/s", 1e-3), "cmp": ("m/s", 1e-2), "kmh": ("m/s", 1 / 3.6), "kph": ("m/s", 1 / 3.6),
    "mph": ("m/s", 0.44704),
}  # fmt: skip
"""Words without the s at their end."""
_ALONE_LENGTHS = {"m": 1.0, "in": 0.0254}
_ALONE_ANGLES = {"rotation": _TURN, "turn": _TURN, "tr": _TURN}
_ALONE_OTHERS = {"v": ("V", 1.0), "a": ("A", 1.0), "n": ("N", 1.0)}
"""Words that mean a unit where a format writes units, and something else in a name."""
_TIMES = {"s": 1.0, "sec": 1.0, "second": 1.0, "min": 60.0, "minute": 60.0, "h": 3600.0, "hr": 3600.0, "hour": 3600.0}
_WITHOUT_SCALE = {
    "%": "duty", "percent": "duty", "pct": "duty", "duty": "duty", "dutycycle": "duty", "pwm": "duty",
    "tick": "counts", "count": "counts", "pulse": "counts",
}  # fmt: skip

HEADINGS = {"heading", "yaw", "theta", "psi", "compass", "bearing"}
_PLACES = HEADINGS | {
    "x",
    "y",
    "z",
    "q",
    "pos",
    "position",
    "angle",
    "phi",
    "distance",
    "dist",
    "way",
    "travel",
    "odometer",
}
_RATES = {"rate", "speed", "velocity", "vel", "dot", "gyro", "omega"}


class Unit(NamedTuple):
    """An SI unit (alternatives joined by " or ") and the factor that leads to it; NaN where only the owner knows the factor.

    `said`: the words it was read from; "duty" and "counts" for shares of a supply and steps of an encoder.
    """

    si: str
    factor: float
    said: str


def metres_of(unit: str) -> float | None:
    """Metres of a unit of length, such as 0.001 of "mm"; None for what is none."""
    return (_LENGTHS | _ALONE_LENGTHS | {"um": 1e-6}).get(unit.lower())


def words_in(text: str) -> list[str]:
    """Lower-case words of a text, a new one at every capital after a small letter; mV, mA and kRPM are one word each."""
    parts = re.findall(r"(?<![A-Za-z])(?:m[VA]|kRPM)(?![a-z])|[A-Z]?[a-z]+|[A-Z]+(?![a-z])", text)
    return [part.lower() for part in parts]


def _singular(word: str) -> str:
    return word[:-1] if len(word) > 1 and word.endswith("s") else word


def _found(
    words: list[str], lengths: dict[str, float], angles: dict[str, float], strict: bool, place: bool = False
) -> Unit | None:
    """The unit that the words from the first on are, lengths and angles per time before those alone. In a name the time is
    often left out (gyro_deg), but not of a `place`."""
    base = _singular(words[0])
    kind = "m" if base in lengths else "rad" if base in angles else ""
    if not kind:
        return None
    factor = lengths[base] if kind == "m" else angles[base]
    rest = words[1:3] if words[1:2] == ["per"] else ["per", *words[1:2]]
    time = _TIMES.get(_singular(rest[1]) if len(rest) > 1 else "")
    if time is not None:
        return Unit(f"{kind}/s", factor / time, f"{words[0]}/{rest[1]}")
    if strict and len(words) > 1:
        return None
    return Unit(kind if strict or place else f"{kind} or {kind}/s", factor, words[0])


def unit_said(text: str) -> Unit | None:
    """The unit that a format writes, such as "Rotation per Second", "deg/s" or `{"unit": "volts"}`; None for no known one."""
    if text.lstrip().startswith("{"):
        try:
            entry = json.loads(text)
        except ValueError:
            return None
        text = next((str(entry[key]) for key in ("unit", "units") if key in entry), "")
    words = re.findall(r"[a-z]+|%", re.sub("[°º]", " deg ", text.lower()))
    if not words:
        return None
    if len(words) == 1 and _singular(words[0]) in _WITHOUT_SCALE:
        return Unit("", math.nan, _WITHOUT_SCALE[_singular(words[0])])
    found = _found(words, _LENGTHS | _ALONE_LENGTHS, _ANGLES | _ALONE_ANGLES, strict=True)
    other = (_OTHERS | _ALONE_OTHERS).get(_singular(words[0])) if len(words) == 1 else None
    found = found or (None if other is None else Unit(*other, words[0]))
    return found and found._replace(said=text.strip())


def unit_in_name(name: str) -> Unit | None:
    """The unit that a name bears, such as `/gyro_dps.vector.z`, `left_mv` or `speed (km/h)`; None without one.

    Of several the last one counts. The factor is NaN for duties and counts.
    """
    bracketed = re.search(r"\s[\[(]([^\])]+)[\])]$", name)
    if bracketed and (found := unit_said(bracketed[1])):
        return found
    ending = re.search(r"[_ ]([VA])$", name)
    if ending:
        return Unit(ending[1], 1.0, ending[1])
    words = words_in(name)
    place = bool(_PLACES & {*words}) and not _RATES & {*words}
    for first in reversed(range(len(words))):
        here = words[first:]
        word = _singular(words[first])
        # Plain m/s and mm: m alone is a letter.
        if words[first] == "m" and _singular("".join(here[1:2]) or "-") in _TIMES:
            return Unit("m/s", 1.0 / _TIMES[_singular(here[1])], f"m/{here[1]}")
        if found := _found(here, _LENGTHS, _ANGLES, strict=False, place=place):
            return found
        if word in _OTHERS:
            return Unit(*_OTHERS[word], words[first])
        if word in _WITHOUT_SCALE:
            return Unit("", math.nan, _WITHOUT_SCALE[word])
    return None
