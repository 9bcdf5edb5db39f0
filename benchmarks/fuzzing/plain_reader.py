"""An independent reader of plain CSV, and what a careful reader of a log would notice: nothing of jaxid."""

import csv
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from jaxid.logs import Log

from .good import Good

_MISSING = {"", "nan", "na", "n/a", "null", "none", "<na>", "#n/a", "-nan", "1.#ind", "1.#qnan", "-1.#ind", "-1.#qnan"}


def _number(cell: str) -> float:
    cell = cell.strip()
    value = np.nan if cell.lower() in _MISSING else float(cell)
    return value if abs(value) <= 1e12 else np.nan


def plain_values(data: bytes, names: Sequence[str]) -> NDArray[np.float64] | None:
    """Columns `names` of comma-separated text, `[T, len(names)]`, NaN where a column or a number is missing.

    None for anything that this reader does not understand.
    """
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    lines = [line for line in text.splitlines() if line.strip(" ,\t;|") and line.strip()[0] not in "#%"]
    header, *rows = list(csv.reader(lines, skipinitialspace=True))
    header = [name.strip() for name in header]
    try:
        columns = [[_number(row[header.index(n)]) if n in header else np.nan for row in rows] for n in names]
    except (ValueError, IndexError):
        return None
    return np.array(columns).T


def visible(good: Good, log: Log) -> bool:
    """Whether a careful reader could tell that this is not the good log: a row missing inside or only a few left, a time
    off by more than an interval, a measurement by half its range, an input beyond three times its largest.

    A single number within what the log does elsewhere, a clean end a few rows earlier, and a name that means nothing to
    the robot cannot be told.
    """
    true_time = good.column("t")
    interval = float(np.median(np.diff(true_time)))
    if len(log) != len(true_time):
        first = int(np.argmin(np.abs(true_time - log.time[0])))
        part = true_time[first : first + len(log)]
        return len(log) < 60 or len(part) != len(log) or bool(np.any(np.abs(part - log.time) > interval))
    if np.any(np.abs(log.time - true_time) > interval):
        return True
    for name in good.inputs:
        if np.any(np.abs(log.input(name)) > 3 * max(np.abs(good.column(name)).max(), 1e-9)):
            return True
    for name in good.outputs:
        read, true = log.output(name), good.column(name)
        if np.any(np.abs(read - true) > 0.5 * np.ptp(true)):
            return True
    return False
