"""Lost samples in whose place the last value stands: what looks measured, and is old."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..logs.finding import Finding
from ..logs.log import Log
from ..logs.noise import white_level
from .samples import finding, quantum, runs

_SHARE, _FEWEST = 0.02, 10
"""Share of the samples, and number of them, from which repeated values are more than chance makes."""
_SHORT = 5
"""Median length [samples] of a stretch above which it is another fault: a frozen sensor, or one at a rate of its own."""
_BY_CHANCE = 3.0
"""Times as many as rounding makes of noise from which they are no rounding."""
_AS_OTHERS = 0.3
"""Share of a usual change by which the value comes to what is repeated: a robot that settles comes to rest more gently."""


def check_repeats(log: Log, name: str, values: NDArray[np.float64]) -> Iterator[Finding]:
    """A noisy column whose value now and then is exactly the one before, for a sample or a few: no noise repeats itself."""
    there = np.isfinite(values)
    known, at = values[there], np.flatnonzero(there)
    if len(known) < 10 * _FEWEST or np.ptp(known) == 0:
        return
    same = (np.diff(known) == 0) & (known[1:] != 0)  # a wheel that stands reads a true zero
    starts, lengths = runs(same)
    share = float(same.mean())
    if share < _SHARE or same.sum() < _FEWEST or np.median(lengths) > _SHORT:
        return
    changes = np.abs(np.diff(known))
    usual = float(np.median(changes[changes > 0]))
    # Two neighbours with noise of this size are rounded to one value by chance so often.
    by_chance = quantum(known) / max(2.0 * np.sqrt(np.pi) * white_level(known), 1e-300)
    before = starts[starts > 0]
    if share < _BY_CHANCE * by_chance or not len(before) or np.median(changes[before - 1]) < _AS_OTHERS * usual:
        return
    text = (
        f"holds exactly the value before in {share:.0%} of the samples, {np.median(lengths):.0f} at a time, as where samples "
        "are lost and the last one stands in their place; leave the repeated cells empty"
    )
    yield finding(log, name, int(at[starts[0]]) + 1, "warning", "repeated_value", text)
