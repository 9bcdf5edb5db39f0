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
from .matlab import TIMES


def _numbers(column: Any) -> Float[np.ndarray, " n"]:
    """Cells as numbers, NaN for those that are none."""
    return pd.Series(pd.to_numeric(column, errors="coerce")).to_numpy(dtype=float, na_value=np.nan)


def read_columns(path: Path, time_field: str | None = None) -> Recording:
    """The numeric columns of a table. `time_field` names the column of times [s]; a usual name is found by itself.

    Raises `LogError` where there is no table, or no column of times.
    """
    table = read_table(path)
    columns = [str(name) for name in table.frame.columns]
    time = time_field if time_field in columns else next((name for name in TIMES if name in columns), None)
    if time is None:
        near = did_you_mean(time_field or "t", columns)
        listed = ", ".join(columns)
        raise LogError(f"{path} has no column of times{near}; it has {listed:.300}: rename one to t, in seconds.")
    numbers = {name: _numbers(table.frame[name]) for name in columns}
    there = np.isfinite(numbers[time])
    try:
        received = nanoseconds(numbers[time][there])
    except ValueError as error:
        raise LogError(f"{path}: column {time!r} {error}; give seconds.") from None
    series, topic = {}, path.name
    for name in columns:
        own = np.isfinite(numbers[name][there])
        if name != time and own.any():
            series[name] = Series(name, topic, numbers[name][there][own], received[own])
    if not series:
        raise LogError(f"{path} has no column of numbers beside {time!r}; give a log of an experiment.")
    notes = tuple((check, text) for check, _, text in table.notes)
    return Recording(series, {topic: Topic(topic, "table", len(received))}, notes)
