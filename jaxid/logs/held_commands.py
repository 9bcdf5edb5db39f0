"""Commands of a table that are written only now and then, when they change or at a rate of their own, with empty cells between:
they are held from row to row, as a motor driver does."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .combine import Signal, silences
from .finding import Severity

Vector = Float[np.ndarray, " n"]

_SELDOM = 0.25
"""Share of the commands that may come in the row after the one before."""


class Held(NamedTuple):
    """The command in every row, and what to say of it, without the file's name and full stop."""

    values: Vector
    severity: Severity
    text: str


def now_and_then(values: Vector) -> bool:
    """Whether a command, NaN where nothing is written, is there in the first row, and then seldom in two that follow one
    another. A column that is written in row after row and then no more has lost what was applied."""
    rows = np.flatnonzero(~np.isnan(values))
    if len(rows) < 2 or rows[0] != 0 or not np.isfinite(values[rows]).all():
        return False
    return float(np.quantile(np.diff(rows), _SELDOM)) >= 2.0


def held(time: Vector, values: Vector, name: str) -> Held:
    """The command `name` [n] held from the rows in which it is written; the first row must be one. A warning says where one
    that came regularly stayed away."""
    there = np.isfinite(values)
    found = values[there][np.cumsum(there) - 1]
    text = f"input {name!r} is written in {np.count_nonzero(there)} of {len(values)} rows and was held between these"
    with np.errstate(invalid="ignore", over="ignore"):
        stamps = np.nan_to_num(time[there] * 1e9).astype(np.int64)
    away = silences({name: Signal(stamps, values[there])}, 0, int(stamps[-1]))
    doubtful = [silence.text for silence in away if silence.severity == "warning"]
    return Held(found, "warning", "; ".join((text, *doubtful[:1]))) if doubtful else Held(found, "note", text)
