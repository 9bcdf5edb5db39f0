"""Stamps that scatter about an even clock, and logs with even ones.

Loops that drive a robot are even to microseconds, while what writes their stamps is late by another share of the interval in
every row.
"""

from dataclasses import replace

import numpy as np

from .log import Log, LogSet

_FEWEST = 50
"""Rows of a log below which its clock is not told."""
_LEAST, _MOST = 0.003, 0.5
"""Scatter of the stamps, in intervals, that is looked at: less does nothing, beyond half of one a row's place is not known."""
_ERRORS = 3.0
"""Standard errors of the interval within which a round one is taken to be the clock's."""
_WANDERS = 0.3
"""Correlation of neighbouring stamps' errors from which they are those of the clock itself."""


def scatter(log: Log) -> tuple[np.ndarray, float]:
    """Stamps of an even clock [T] for a log, and how far the log's own scatter about them, in intervals; zero where they do not
    scatter about an even clock. Rows that are missing have their places, if the steps tell where."""
    steps = np.diff(log.time)
    skipping = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(steps / np.median(steps)), 1.0))])
    found = []
    for places in (np.arange(len(log), dtype=float), skipping):
        interval, begin = np.polyfit(places, log.time, 1)
        error = float(np.std(log.time - begin - interval * places)) / (np.std(places) * np.sqrt(len(log)))
        round_one = float(f"{interval:.3g}")  # loops run at round rates; a part in 100,000 is counts of a fine encoder
        if abs(interval - round_one) < _ERRORS * error:
            interval, begin = round_one, float(np.mean(log.time - round_one * places))
        even = begin + interval * places
        found.append((even, (log.time - even) / interval))
    even, apart = min(found, key=lambda one: float(np.max(np.abs(one[1]))))
    size = float(np.std(apart))
    known = len(log) >= _FEWEST and size > _LEAST and float(np.max(np.abs(apart))) < _MOST
    wanders = known and float(apart[1:] @ apart[:-1]) > _WANDERS * float(apart @ apart)
    return even, size if known and not wanders else 0.0


def evenly(logs: LogSet) -> tuple[LogSet, list[float]]:
    """The logs with even stamps where theirs scatter, and by how much those do, in intervals."""
    found, sizes = [], []
    for log in logs:
        even, size = scatter(log)
        found.append(replace(log, time=even) if size else log)
        sizes += [size] if size else []
    return LogSet(found), sizes
