"""Stamps that scatter about an even clock, and logs with even ones.

Loops that drive a robot are even to microseconds, while what writes their stamps is late by another share of the interval in
every row.
"""

from dataclasses import replace

import numpy as np

from .log import Log, LogSet

_FEWEST = 50
"""Rows of a log below which its clock is not told."""
_LEAST, _MOST, _FARTHEST = 0.003, 0.25, 1.0
"""Scatter of the stamps, in intervals, that is looked at: less does nothing, beyond a quarter, or a whole of one in any row, a
row's place is not known."""
_FIRST, _AGAIN = (12, 25, 50), 3
"""Rows from whose interval the places of twice as many are told (the best of several), and how often by the line through all
of these."""
_ERRORS = 3.0
"""Standard errors of the interval within which a round one is taken to be the clock's."""
_WANDERS = 0.3
"""Correlation of neighbouring stamps' errors from which they are those of the clock itself."""


def _places(time: np.ndarray, first: int) -> np.ndarray:
    """Which tick of the clock every row is of [T], one later each or more where rows are missing: of ever more rows, of so many
    `first`, by the line through those before, since steps that scatter do not tell one by one how many rows are missing."""
    places = _one_each((time[:first] - time[0]) / float(np.median(np.diff(time))))
    while True:
        # A row that was missing only by a step that scattered is found where the line goes through the later ones.
        for _ in range(_AGAIN):
            interval, begin = np.polyfit(places, time[: len(places)], 1)
            places = _one_each((time[: len(places)] - begin) / interval)
        if len(places) == len(time):
            return places
        interval, begin = np.polyfit(places, time[: len(places)], 1)
        places = _one_each((time[: 2 * len(places)] - begin) / interval)


def _one_each(ticks: np.ndarray) -> np.ndarray:
    """The whole numbers that are nearest to these ones and increase, from zero: least squares of what is missing before every
    row, which never falls, is rounded isotonic regression."""
    from scipy.optimize import isotonic_regression  # takes a while to import, and few logs ask for it

    own = np.arange(len(ticks))
    missing = np.round(isotonic_regression(ticks - own).x)
    return own + missing - missing[0]


def scatter(log: Log) -> tuple[np.ndarray, float]:
    """Stamps of an even clock [T] for a log, and how far the log's own scatter about them, in intervals; zero where they do not
    scatter about an even clock. Rows that are missing have their places, if the steps tell where."""
    found = []
    for places in (np.arange(len(log), dtype=float), *(_places(log.time, first) for first in _FIRST)):
        interval, begin = np.polyfit(places, log.time, 1)
        error = float(np.std(log.time - begin - interval * places)) / (np.std(places) * np.sqrt(len(log)))
        round_one = float(f"{interval:.3g}")  # loops run at round rates; a part in 100,000 is counts of a fine encoder
        if abs(interval - round_one) < _ERRORS * error:
            interval, begin = round_one, float(np.mean(log.time - round_one * places))
        even = begin + interval * places
        found.append((even, (log.time - even) / interval))
        if np.std(found[-1][1]) < _LEAST:
            break
    even, apart = min(found, key=lambda one: float(np.std(one[1])))
    size = float(np.std(apart))
    known = len(log) >= _FEWEST and _LEAST < size < _MOST and float(np.max(np.abs(apart))) < _FARTHEST
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
