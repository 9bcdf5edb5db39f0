"""The column of times of a table: which one it is, in which unit, and dates as seconds."""

import math
import re
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

_NAMES = {
    "t",
    "time",
    "times",
    "tout",
    "timestamp",
    "stamp",
    "timestamps",
    "zeit",
    "zeitstempel",
    "temps",
    "tiempo",
    "tempo",
    "sec",
}
"""Words of a name that mean times."""
_UNITS = {"s": 1.0, "sec": 1.0, "second": 1.0, "ms": 1e-3, "msec": 1e-3, "millisecond": 1e-3} | {
    "us": 1e-6, "usec": 1e-6, "microsecond": 1e-6, "µs": 1e-6, "ns": 1e-9, "nsec": 1e-9, "nanosecond": 1e-9,
    "min": 60.0, "minute": 60.0,
}  # fmt: skip
_EPOCHS = (
    (1e9, 1.0, "seconds"),
    (1e12, 1e-3, "milliseconds"),
    (1e15, 1e-6, "microseconds"),
    (1e18, 1e-9, "nanoseconds"),
)
"""Sizes of today's date since 1970 in its units, and the factors to seconds."""
_FAR_APART = 60.0
"""Seconds between two rows that no robot's log leaves as a rule."""


_OF_DAY = r"\s*\d{1,2}:\d\d:\d\d(\.\d+)?\s*"
_DAY = 86400.0
SINCE_1970 = 5e8
"""Seconds from which on a time is a date counted from 1970, and no experiment's own."""


class TimeColumn(NamedTuple):
    """Its name, the factor that makes seconds of its numbers, and what says so (empty where nothing does)."""

    column: str
    scale: float
    said: str


_FEW_LATE = 0.1
"""Share of the rows that may have come late."""
_MISSED = 1.4
"""Intervals, in usual ones, from which on a row is missing between two."""


_COUNTED = 20
"""Rows from which on 0, 1, 2 … are a count: a handful may well be a second apart."""


def order_of_late_rows(time: Float[np.ndarray, " n"]) -> Int[np.ndarray, " n"] | None:
    """The order in which rows were measured of which a few were written later than their followers; None where none was, or
    where the clock was set back: then the others leave no place where a late row is missing. Rows of one time, which are not
    looked into, keep their order."""
    if not np.isfinite(time).all() or not len(time):
        return None
    late = time < np.maximum.accumulate(time)
    if not late.any() or late.mean() > _FEW_LATE:
        return None
    kept = time[~late]
    steps = np.diff(kept)
    after = np.searchsorted(kept, time[late])
    alone = ~np.isin(time[late], kept)  # or else it is there a second time
    if np.any(after == 0) or not (steps > 0).any():
        return None
    missed = steps[after - 1] > _MISSED * float(np.median(steps[steps > 0]))
    return np.argsort(time, kind="stable") if np.all(missed | ~alone) else None


def seconds_of_dates(values: Any) -> Float[np.ndarray, " n"] | None:
    """Seconds since the first of dates or times of day, across midnight, too, or of durations; None for what is neither."""
    column: Any = pd.Series(values)
    if column.dtype.kind == "m":
        return (column / pd.Timedelta(1, "s")).to_numpy(dtype=float)
    if column.dtype.kind in "OUT" or isinstance(column.dtype, pd.StringDtype):
        if np.isfinite(_numbers(column)).any():
            return None
        if column.astype(str).str.fullmatch(_OF_DAY).all():
            seconds = (pd.to_timedelta(column.astype(str)) / pd.Timedelta(1, "s")).to_numpy(dtype=float)
            return np.unwrap(seconds, period=_DAY) - seconds[0]
        column = pd.to_datetime(column, errors="coerce", utc=True, format="ISO8601")
    if column.dtype.kind != "M" or not len(column) or pd.isna(column.iloc[0]):
        return None
    return ((column - column.iloc[0]) / pd.Timedelta(1, "s")).to_numpy(dtype=float)


def with_seconds(frame: pd.DataFrame, column: str) -> pd.DataFrame:
    """The table with seconds since the first row where a column holds dates."""
    found = seconds_of_dates(frame[column]) if column in frame.columns else None
    return frame if found is None else frame.assign(**{column: found})


def _numbers(column: Any) -> Float[np.ndarray, " n"]:
    return pd.Series(pd.to_numeric(column, errors="coerce")).to_numpy(dtype=float, na_value=np.nan)


def _words(name: str) -> list[str]:
    return [word.lower() for word in re.findall(r"[A-Z]?[a-zµ]+|[A-Z]+(?![a-z])", name)]


def since_1970(values: Float[np.ndarray, " n"]) -> tuple[float, str]:
    """The factor to seconds of times that count from 1970, as their size tells, and their unit; 1 and nothing of others."""
    typical = float(np.median(np.abs(values))) if len(values) else 0.0
    step = float(np.median(np.abs(np.diff(values)))) if len(values) > 1 else 0.0
    # Nanoseconds since a computer was started are as many as milliseconds since 1970, and far apart as such.
    fits = ((factor, unit) for size, factor, unit in _EPOCHS if 0.5 * size < typical < 5.0 * size)
    return next(((factor, unit) for factor, unit in fits if factor * step < _FAR_APART), (1.0, ""))


def _unit(name: str, values: Float[np.ndarray, " n"]) -> tuple[float, str]:
    """Factor to seconds, and what says so: the name's last unit, else the size of a date since 1970."""
    for word in reversed(_words(name)) if name != "t" else ():
        base = word[:-1] if len(word) > 3 and word.endswith("s") else word
        if base in _UNITS and (base != "s" or len(_words(name)) > 1):
            return _UNITS[base], f"the name says {word}"
    factor, unit = since_1970(values)
    return factor, f"{unit} since 1970 by their size" if unit else ""


def seconds_in_name(name: str) -> float | None:
    """The factor to seconds of what a name calls times in a unit (`t_ms`), and nothing else; None for any other name."""
    words = _words(name)
    return _UNITS.get(words[1]) if len(words) == 2 and words[0] in _NAMES else None


def time_column(frame: pd.DataFrame, given: str | None = None) -> TimeColumn | None:
    """The column of times: `given`, or the first that a name calls so, or the first whose numbers or dates all increase; None
    where there is none."""
    columns = [str(name) for name in frame.columns]
    if given in columns:
        names = [str(given)]
    elif "t" in columns:
        names = ["t"]
    else:
        called = [name for name in columns if set(_words(name)) & _NAMES]
        names = [*called, *(name for name in columns if name not in called)]
    for name in names:
        dates = seconds_of_dates(frame[name])
        values = _numbers(frame[name]) if dates is None else dates
        there = values[np.isfinite(values)]
        if given is None and len(there) < (1 if set(_words(name)) & _NAMES else 2):
            continue
        if given is None and len(there) > 1 and np.mean(np.diff(there) > 0) < 0.9:
            continue
        if dates is not None:
            return TimeColumn(name, 1.0, "dates")
        scale, said = _unit(name, there) if len(there) else (1.0, "")
        return TimeColumn(name, scale, said) if math.isfinite(scale) else None
    return None


def unit_doubt(time: Float[np.ndarray, " n"]) -> str:
    """Why increasing times are hardly seconds, as the beginning of a sentence; empty where they may be."""
    interval, duration = float(np.median(np.diff(time))), float(time[-1] - time[0])
    # Milliseconds make hours of a run, hours make an instant of it; whole numbers without a gap are those of the rows.
    if len(time) >= _COUNTED and np.array_equal(time - time[0], np.arange(len(time))):
        return "t counts the rows (0, 1, 2 …) and says no seconds"
    if (interval >= 0.5 and duration > 3600) or (interval < 2e-5 and duration < 0.1):
        return f"a sampling interval of {interval:.4g} s over {duration:.4g} s is unlikely for a robot"
    return ""
