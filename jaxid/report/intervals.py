"""95 % intervals side by side, as a drawing in a table's cell and in words."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..estimate.result import Estimate
from .tables import Cell, Interval, Mark, constant, number, title_of


def intervals(
    name: str, own: Mapping[str, Estimate | None], colours: Sequence[str], known: float = math.nan, kind: str = ""
) -> Cell:
    """The intervals of a parameter by method, each in its colour, around the `known` value or the last method's.

    The scale is the row's own: it spans all the intervals.
    """
    shown = {label: e for label, e in own.items() if e is not None and np.isfinite(e.value) and e.status != "fixed"}
    if not shown:
        return Cell("")
    centre = known if np.isfinite(known) else list(shown.values())[-1].value
    edges = [x for e in shown.values() for x in (e.value, *(e.ci95 if e.status == "identified" else ()))]
    half = max([abs(x - centre) for x in edges if np.isfinite(x)], default=0.0) * 1.1 or 1.0

    def across(x: float) -> float:
        return round(float(np.clip(50.0 + 50.0 * (x - centre) / half, 0.0, 100.0)), 2)

    marks, words = [], []
    for k, (label, e) in enumerate(own.items()):
        if e is None or label not in shown:
            continue
        sure = e.status == "identified" and bool(np.isfinite(e.ci95).all())
        low, high = e.ci95 if sure else (e.value, e.value)
        at = round(12.0 * (k + 1) / (len(own) + 1), 2)
        marks.append(Mark(across(low), across(e.value), across(high), at, colours[k % len(colours)]))
        words.append(f"{title_of(label)} {number(low, 3)} to {number(high, 3)}" if sure else f"{title_of(label)} none")
    around = f"around the {kind} value {constant(known)}: " if np.isfinite(known) else ""
    return Cell("", interval=Interval(tuple(marks), f"{name}: {around}{', '.join(words)}"))
