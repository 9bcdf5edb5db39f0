"""What looks measured, and is old: lost samples in whose place the last value stands, and stretches that stand twice."""

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


_WINDOW, _DISTINCT = 20, 15
"""Rows in a row, and different values of an output among them, that no sensor shows twice by chance."""
_FACTOR = np.uint64(6364136223846793005)
"""By which what stands for rows is put together: a number of its own for every window."""
_MOST = 0.3
"""Share of the rows from which the motion repeats itself, to the last digit, as one without noise does."""


def check_stretches(log: Log) -> Iterator[Finding]:
    """A stretch whose rows, inputs and outputs, stand a second time: a buffer that was written twice, a file put together
    wrongly."""
    count = len(log) - _WINDOW + 1
    if count < 2 * _WINDOW:
        return
    words, names = np.zeros(len(log), np.uint64), np.zeros(count, np.uint64)
    rows = np.ascontiguousarray(np.concatenate([log.inputs, np.nan_to_num(log.outputs)], axis=1).T)
    for column in rows.view(np.uint64):
        words = (words ^ (words >> np.uint64(29))) * _FACTOR + column
    for k in range(_WINDOW):
        names = names * _FACTOR + words[k : k + count]
    order = np.argsort(names, kind="stable")
    again = np.flatnonzero(names[order[1:]] == names[order[:-1]])
    first, second = order[again], order[again + 1]
    # At standstill all windows are alike, and there are many.
    changes = np.cumsum(np.any(np.diff(rows, axis=1, prepend=np.nan) != 0.0, axis=0))
    moved = changes[second + _WINDOW - 1] - changes[second] >= _DISTINCT - 1
    first, second = first[moved], second[moved]

    def twice(a: int, b: int) -> bool:
        one, other = rows[:, a : a + _WINDOW], rows[:, b : b + _WINDOW]
        outputs = one[len(log.channels.inputs) :]
        return bool(np.array_equal(one, other) and max(len(np.unique(own)) for own in outputs) >= _DISTINCT)

    rich = np.array([twice(a, b) for a, b in zip(first, second, strict=True)], bool)
    first, second = first[rich], second[rich]
    if not len(second) or len(second) > _MOST * count:
        return
    apart = second - first
    lag = int(np.bincount(apart).argmax())
    begin = int(second[apart == lag].min())
    end = int(second[apart == lag].max()) + _WINDOW
    text = (
        f"rows {begin} to {end - 1} ({log.time[end - 1] - log.time[begin]:.3g} s) hold the same numbers as those from row "
        f"{begin - lag} on, as where a stretch was written twice; leave one of the two out, and cut the log there"
    )
    yield finding(log, None, begin, "warning", "repeated_stretch", text)
