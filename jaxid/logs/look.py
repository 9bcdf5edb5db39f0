"""A look at a file before anything is made of it: its streams, how regularly they came, and what is odd about its signals."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .formats import read_recording
from .formats.columns import read_columns
from .series import Recording, Series, Topic
from .supply import is_supply, said_fall

_GAP = 2.5
"""Intervals, in usual ones, from which on messages are missing."""
_FROZEN = 20
"""Equal values in a row, after which a signal that changes otherwise counts as frozen."""


class Stream(NamedTuple):
    """How one topic came: usual `interval` [s], `jitter` (share of it, standard deviation about it without the gaps), number of
    gaps and the longest one [s], usual and largest time [s] from a message's stamp to its receipt (NaN without stamps)."""

    topic: Topic
    fields: int
    interval: float
    jitter: float
    gaps: int
    longest: float
    late: float
    latest: float


class Look(NamedTuple):
    """What a file holds: its `recording`, its `streams`, and what is doubtful about single fields, by name."""

    recording: Recording
    streams: tuple[Stream, ...]
    doubts: dict[str, str]


def _stream(topic: Topic, series: Sequence[Series]) -> Stream:
    """Of the fields of one topic; the one with the most samples shows how it came."""
    nothing = float("nan")
    fullest = max(series, key=len, default=None)
    if fullest is None or len(fullest) < 2:
        return Stream(topic, len(series), nothing, nothing, 0, nothing, nothing, nothing)
    time = fullest.received if fullest.stamped is None else fullest.stamped
    steps = np.diff(np.unique(time)) * 1e-9
    usual = float(np.median(steps)) if len(steps) else nothing
    usually = steps[steps <= _GAP * usual]
    jitter = float(np.std(usually) / usual) if len(usually) and usual > 0 else nothing
    late = latest = nothing
    if fullest.stamped is not None:
        delay = (fullest.received - fullest.stamped) * 1e-9
        late, latest = float(np.median(delay)), float(np.max(delay))
    gaps = int(np.count_nonzero(steps > _GAP * usual))
    return Stream(topic, len(series), usual, jitter, gaps, float(steps.max(initial=0.0)), late, latest)


_COORDINATE = re.compile(r"(.*(?:position|translation))\.([xyz])")
_HEADING = re.compile(r"(.*)(orientation|rotation)\.(?:[xyzw]|yaw)")
_PLACE = {"orientation": "position", "rotation": "translation"}
_SMOOTH = 0.5
"""Spread of a signal's steps, in that of the signal, below which it follows the motion rather than noise."""
_MOVES = 0.2
"""Spread over a stretch, in that over the whole file, from which on a signal moves there."""


def _time(series: Series) -> np.ndarray:
    return series.received if series.stamped is None else series.stamped


class _Motion:
    """Commands and measurements that follow the motion, to tell a sensor that froze from a robot that stood still."""

    def __init__(self, every: Sequence[Series]):
        self._by_name = {series.name: series for series in every}
        self._moving = []
        for series in every:
            finite = np.isfinite(series.values)
            values, time = series.values[finite], _time(series)[finite]
            spread = float(np.std(values)) if len(values) > 2 else 0.0
            if spread > 0 and float(np.std(np.diff(values))) < _SMOOTH * spread:
                self._moving.append((series.topic, time, values, spread))

    def explains(self, series: Series, begin: int, end: int) -> bool:
        """Whether a signal may well have stayed the same between two times [ns]: nothing moved, or along another axis, or
        straight ahead."""
        coordinate = _COORDINATE.fullmatch(series.name)
        along = [] if coordinate is None else [f"{coordinate[1]}.{axis}" for axis in "xyz" if axis != coordinate[2]]
        heading = _HEADING.fullmatch(series.name)
        along += [] if heading is None else [f"{heading[1]}{_PLACE[heading[2]]}.{axis}" for axis in "xyz"]
        for other in (self._by_name[name] for name in along if name in self._by_name):
            there = other.values[(_time(other) >= begin) & (_time(other) <= end)]
            if len(there) and np.ptp(there) > 0:
                return True
        return not self._elsewhere(series.topic, begin, end)

    def _elsewhere(self, topic: str, begin: int, end: int) -> bool:
        """Whether anything of another topic moved between two times; True where there is nothing to tell it by."""
        others = [(time, values, spread) for other, time, values, spread in self._moving if other != topic]
        for time, values, spread in others:
            there = values[(time >= begin) & (time <= end)]
            if len(there) > 1 and float(np.std(there)) > _MOVES * spread:
                return True
        return not others


def _doubt(series: Series, motion: _Motion) -> str:
    """What is odd about one signal; empty where nothing is."""
    if series.fault:
        return series.fault
    values = series.values
    finite = values[np.isfinite(values)]
    if not len(finite):
        return "holds no number"
    if len(finite) < len(values):
        return f"is not finite in {len(values) - len(finite)} of {len(values)} messages"
    time = _time(series)
    if np.any(np.diff(time) < 0):
        return f"has stamps that run backwards ({np.count_nonzero(np.diff(time) < 0)} time(s))"
    if np.ptp(values) == 0:
        return ""
    edges = np.concatenate([[-1], np.flatnonzero(np.diff(values) != 0), [len(values) - 1]])
    lengths = np.diff(edges)
    for which in np.flatnonzero(lengths > _FROZEN):
        if motion.explains(series, int(time[edges[which] + 1]), int(time[edges[which + 1]])):
            lengths[which] = 0
    longest = int(np.max(lengths))
    changing = np.count_nonzero(np.diff(values) != 0) > 0.5 * len(values)
    if changing and longest > _FROZEN and len(values) > 4 * _FROZEN:
        return f"stays the same for {longest} messages in a row, while it changes nearly always otherwise"
    if is_supply(series.name, series.unit) and (said := said_fall(values)):
        return said.split(":")[0]
    return ""


def look(path: Path, time_field: str | None = None) -> Look:
    """What the file at `path` holds. `time_field` names the times of a table or a MATLAB file, where they have an unusual name.

    Raises `LogError` for whatever cannot be read.
    """
    recording = read_recording(path, time_field=time_field) or read_columns(path, time_field)
    own: dict[str, list[Series]] = {}
    for series in recording.series.values():
        own.setdefault(series.topic, []).append(series)
    streams = tuple(_stream(topic, own.get(name, [])) for name, topic in recording.topics.items())
    motion = _Motion(list(recording.series.values()))
    doubts = {name: said for name, series in recording.series.items() if (said := _doubt(series, motion))}
    return Look(recording, streams, doubts)
