"""A look at a file before anything is made of it: its streams, how regularly they came, and what is odd about its signals."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .formats import read_recording
from .formats.columns import read_columns
from .series import Recording, Series, Topic

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


def _doubt(series: Series) -> str:
    """What is odd about one signal by itself; empty where nothing is."""
    if series.fault:
        return series.fault
    values = series.values
    finite = values[np.isfinite(values)]
    if not len(finite):
        return "holds no number"
    if len(finite) < len(values):
        return f"is not finite in {len(values) - len(finite)} of {len(values)} messages"
    time = series.received if series.stamped is None else series.stamped
    if np.any(np.diff(time) < 0):
        return f"has stamps that run backwards ({np.count_nonzero(np.diff(time) < 0)} time(s))"
    if np.ptp(values) == 0:
        return ""
    edges = np.flatnonzero(np.diff(values) != 0)
    longest = int(np.max(np.diff(np.concatenate([[-1], edges, [len(values) - 1]]))))
    changing = np.count_nonzero(np.diff(values) != 0) > 0.5 * len(values)
    if changing and longest > _FROZEN and len(values) > 4 * _FROZEN:
        return f"stays the same for {longest} messages in a row, while it changes nearly always otherwise"
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
    doubts = {name: said for name, series in recording.series.items() if (said := _doubt(series))}
    return Look(recording, streams, doubts)
