"""CSV and Parquet files as recordings, for looking at them: their columns beside the column of time.

Reading them into logs does not go this way: a table has one clock, and its rows stay as they are.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float

from ..finding import LogError
from ..log import did_you_mean
from ..series import Recording, Series, Topic, nanoseconds
from ..table import read_table
from ..times import order_of_late_rows, time_column, with_seconds


def _numbers(column: Any) -> Float[np.ndarray, " n"]:
    """Cells as numbers, NaN for those that are none."""
    return pd.Series(pd.to_numeric(column, errors="coerce")).to_numpy(dtype=float, na_value=np.nan)


def read_columns(path: Path, time_field: str | None = None) -> Recording:
    """The numeric columns of a table. `time_field` names the column of times; a usual name, or one that increases, is found by
    itself, in seconds or what its name or size says.

    Raises `LogError` where there is no table, or no column of times.
    """
    table = read_table(path)
    columns = [str(name) for name in table.frame.columns]
    found = time_column(table.frame, time_field)
    if found is None:
        near = did_you_mean(time_field or "t", columns)
        listed = ", ".join(columns)
        raise LogError(f"{path} has no column of times{near}; it has {listed:.300}: rename one to t, in seconds.")
    time, frame = found.column, with_seconds(table.frame, found.column)
    numbers = {name: _numbers(frame[name]) for name in columns}
    order = order_of_late_rows(numbers[time])
    if order is not None:
        numbers = {name: values[order] for name, values in numbers.items()}
        table.notes.append(
            ("out_of_order", None, "rows that came after later ones were put in the order of their times")
        )
    there = np.isfinite(numbers[time])
    try:
        first = numbers[time][there][0] if there.any() else 0.0
        received = nanoseconds(found.scale * (numbers[time][there] - first))
    except ValueError as error:
        raise LogError(f"{path}: column {time!r} {error}; map t with the scale that gives seconds.") from None
    series, topic = {}, path.name
    for name in columns:
        own = np.isfinite(numbers[name][there])
        if name != time and own.any():
            series[name] = Series(name, topic, numbers[name][there][own], received[own])
    if not series:
        raise LogError(f"{path} has no column of numbers beside {time!r}; give a log of an experiment.")
    notes = tuple((check, text) for check, _, text in table.notes)
    return Recording(series, {topic: Topic(topic, "table", len(received))}, notes, found, float(found.scale * first))
