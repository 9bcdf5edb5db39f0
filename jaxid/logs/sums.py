"""Channels that are weighted sums of a file's columns or fields: the speed of a robot's middle from those of its wheels.

Fields of one topic are added message by message. Those of others are taken at the instants of the first field, between two
samples on the straight line through them, which a note says.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from .finding import LogError
from .log import did_you_mean
from .mapping import Source
from .rates import unwrapped
from .series import Recording, Series
from .table import Table

Note = tuple[str, str]
"""Check, and what to say, without the file's name and full stop."""


def with_summed_columns(
    table: Table, mapping: Mapping[str, Source], numbers: Callable[[str], np.ndarray], path: Path
) -> Table:
    """The table, and a column for every sum that the mapping asks for; `numbers` reads a column.

    Raises `LogError` for a column that is not there.
    """
    frame = table.frame
    for name, source in mapping.items():
        for column, _ in source.terms:
            if column not in frame.columns:
                near = did_you_mean(column, [str(other) for other in frame.columns])
                raise LogError(f"{path} has no column {column!r} (for {name!r}){near}; correct the mapping.")
        if source.terms:
            parts = [(numbers(column), weight) for column, weight in source.terms]
            frame = frame.assign(**{source.column: _sum(parts, source.derivative)})
    return Table(frame, table.lines, table.notes)


def _sum(parts: list[tuple[np.ndarray, float]], positions: bool) -> np.ndarray:
    """Weighted sum; where it is one of positions to be differentiated each is unwrapped before."""
    total = np.zeros(len(parts[0][0]))
    for values, weight in parts:
        there = np.isfinite(values)
        whole = values.astype(float)
        if positions:
            whole[there] = unwrapped(whole[there])
        total = total + weight * whole
    return total


def with_summed_fields(
    recording: Recording, mapping: Mapping[str, Source], find: Callable[[str, str], Series], path: Path
) -> tuple[Recording, list[Note]]:
    """The recording, and a series for every sum that the mapping asks for, and what was decided.

    `find` gives the series of a field for a channel, and raises `LogError` where there is none. Raises it, too, where two
    fields never overlap.
    """
    series, notes = dict(recording.series), []
    for name, source in mapping.items():
        if not source.terms:
            continue
        each = [(find(field, name), weight) for field, weight in source.terms]
        first = each[0][0]
        inside = np.ones(len(first), dtype=bool)
        for other, _ in each[1:]:
            inside &= (_time(first) >= _time(other)[0]) & (_time(first) <= _time(other)[-1])
        if not inside.any():
            raise LogError(f"{path}: the fields of {name!r} were never recorded at the same time; map it to others.")
        time = _time(first)[inside]
        parts = []
        for one, weight in each:
            values = unwrapped(one.values) if source.derivative else one.values
            if len(_time(one)) != len(first) or np.any(_time(one) != _time(first)):
                values = np.interp(time - time[0], _time(one) - time[0], values)
                notes.append(
                    ("interpolated", f"{one.name!r} was taken between its samples at the times of {first.name!r}")
                )
            else:
                values = values[inside]
            parts.append((values, weight))
        stamped = None if first.stamped is None else first.stamped[inside]
        series[source.column] = replace(
            first, name=source.column, values=_sum(parts, False), received=first.received[inside], stamped=stamped,
            unit="", to_si=1.0, said="",
        )  # fmt: skip
    return replace(recording, series=series), notes


def _time(series: Series) -> np.ndarray:
    return series.received if series.stamped is None else series.stamped
