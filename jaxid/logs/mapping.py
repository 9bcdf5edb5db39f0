"""A user's mapping: standard column name to the file's column or field, or a weighted sum of several, with scale and offset; a
dict or a TOML file."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from .._toml import read_toml, shown
from .channels import POSE, Channels
from .finding import LogError
from .log import did_you_mean


class Source(NamedTuple):
    """Where a standard column comes from: value = scale * column + offset, or, for time, interval * row.

    `column` is a table's column or a recording's field, such as `/odom.twist.twist.linear.x`. `derivative`: the rate of change
    of that is meant. `integral`: what it adds up to over time is. `held`: a command that is written only when it changes.
    `stamp`, of time: whose clock counts in a recording, the sender's ("header") or the recorder's ("receive"). `terms`: columns
    and their weights, where `column` is their sum and its name.
    """

    column: str
    scale: float = 1.0
    offset: float = 0.0
    interval: float | None = None
    derivative: bool = False
    integral: bool = False
    held: bool = False
    stamp: str | None = None
    terms: tuple[tuple[str, float], ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """What is to be read from the file."""
        return tuple(name for name, _ in self.terms) or (self.column,)


STAMPS = ("header", "receive")
_NUMBERS = ("scale", "offset", "interval")


def _finite(value: Any) -> bool:
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an integer beyond the largest float
        return False


def _shown(terms: tuple[tuple[str, float], ...]) -> str:
    """A weighted sum in words, such as "0.05 right - 0.05 left"."""
    text = " ".join(f"{'-' if weight < 0 else '+'} {abs(weight):.6g} {field}" for field, weight in terms)
    return text.removeprefix("+ ")


def _wrong(key: str, value: Any) -> str:
    """What an entry's value should be instead; empty where it is right."""
    if key in _NUMBERS:
        return "" if _finite(value) else "give a number"
    if key in ("derivative", "integral", "held"):
        return "" if isinstance(value, bool) else "give true or false"
    if key == "stamp":
        return "" if value in STAMPS else f"use {' or '.join(map(repr, STAMPS))}"
    if key == "fields":
        weighted = isinstance(value, Mapping) and len(value) and all(_finite(w) and w != 0 for w in value.values())
        return "" if weighted else "give the fields with their weights, such as { right = 0.05, left = 0.05 }"
    return "" if isinstance(value, str) else "give a name"


def _source(place: str, name: str, entry: Any, positions: tuple[str, ...]) -> Source:
    if isinstance(entry, str):
        return Source(entry)
    if not isinstance(entry, Mapping):
        raise LogError(f"{place} of {name!r} is {shown(entry)}; give a column name or {{column=..., scale=...}}.")
    own = ("interval", "stamp") if name == "t" else ("fields", "derivative", "integral", "held")
    known = ("column", "field", "scale", "offset", *own)
    for key, value in entry.items():
        if key not in known:
            raise LogError(
                f"{place} of {name!r} has an unknown entry {key!r:.60}; use {', '.join(known)}, which lead to SI units."
            )
        if wrong := _wrong(key, value):
            raise LogError(f"{place} of {name!r} has {key} = {value!r:.60}; {wrong}.")
    if entry.get("scale", 1) == 0 or entry.get("interval", 1) <= 0:
        raise LogError(f"{place} of {name!r} has a scale or interval of zero or less where it cannot; correct it.")
    if "interval" in entry and len(entry) > 1:
        raise LogError(f"{place} of {name!r} has an interval and a column or scale; give one of the two.")
    if entry.get("integral") and (entry.get("derivative") or name not in positions):
        raise LogError(
            f"{place} of {name!r} asks for an integral; only positions are one of a speed"
            f"{' (' + ', '.join(positions) + ')' if positions else ', and this robot has none that stand for speeds'}."
        )
    several = [key for key in ("column", "field", "fields") if key in entry]
    if len(several) > 1:
        raise LogError(f"{place} of {name!r} has a {' and a '.join(several)}; give one of them.")
    found = {"column" if key == "field" else key: value for key, value in entry.items() if key != "fields"}
    if terms := tuple((str(field), float(weight)) for field, weight in entry.get("fields", {}).items()):
        found |= {"terms": terms, "column": _shown(terms)}
    return Source(**{"column": name, **found})


def read_mapping(mapping: Mapping[str, Any] | str | Path | None, channels: Channels) -> dict[str, Source]:
    """The file's column of each standard column that the mapping names.

    Raises `LogError` for a file that cannot be opened or is not TOML, names that are no column of the robot, and entries
    that say nothing sensible.
    """
    if mapping is None:
        return {}
    place = f"The mapping {mapping}" if isinstance(mapping, str | Path) else "The mapping"
    if isinstance(mapping, str | Path):
        try:
            mapping = read_toml(Path(mapping))
        except OSError as error:
            raise LogError(f"{place} cannot be opened ({error.strerror}); check the path.") from None
        except ValueError as error:
            raise LogError(
                f'The mapping {mapping} is not TOML ({error}); write lines like V2 = "right_volts".'
            ) from None
    known = ("t", *channels, *POSE)
    for name in mapping:
        if name not in known:
            raise LogError(
                f"{place} names {name!r:.60}, which is no column of this robot{did_you_mean(name, known)}; use "
                f"{', '.join(known)}, each with the name that the file has for it."
            )
    return {name: _source(place, name, entry, channels.positions) for name, entry in mapping.items()}


def sources_of(names: Iterable[str], mapping: Mapping[str, Source]) -> dict[str, Source]:
    """Where each of the standard columns `names` comes from: as mapped, else the column of its own name, unless that is a speed
    whose integral is mapped in its place."""
    summed = {column for source in mapping.values() if source.integral for column in source.columns}
    return {name: mapping.get(name, Source(name)) for name in names if name in mapping or name not in summed}


def mapped_names(mapping: Mapping[str, Any] | str | Path | None) -> tuple[str, ...]:
    """The standard columns that a mapping names. Raises `OSError` and `ValueError` where it cannot be read."""
    return tuple(read_toml(Path(mapping)) if isinstance(mapping, str | Path) else mapping or ())
