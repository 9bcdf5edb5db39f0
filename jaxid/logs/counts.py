"""Speeds that a program made of an encoder's counts, added up to these again."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .finding import LogError

Array = NDArray[np.float64]
_FEWEST = 50
"""Rows in which a wheel turns from which counts are told."""
_AGREE = 0.9
"""Length of the mean phase from which increments are counts: what is left of each is then a fourteenth of a count."""
_BINS, _FINER = 1 << 14, 4
"""Bins of the increments, and how much finer than their transform's own the frequencies are at which counts are tried."""


def count_of(increments: Array) -> float:
    """What all `increments` [N] are whole numbers of, each within rounding of its digits; zero where there is nothing.

    The phases that a count of the right size gives them all agree, so that their mean is of length one (the characteristic
    function of a lattice); the smallest frequency at which it is belongs to the count itself.
    """
    moved = increments[np.abs(increments) > 1e-6 * np.max(np.abs(increments), initial=0.0)]
    if len(moved) < _FEWEST:
        return 0.0
    most = float(np.max(np.abs(moved)))
    drawn, _ = np.histogram(moved, _BINS, (-most, most))
    bin_ = 2.0 * most / _BINS
    agree = np.abs(np.fft.rfft(drawn, _FINER * _BINS))[: _FINER * _BINS // 16] / len(moved)
    # Phases of what is not far from zero agree at any count that is large enough: not before they have all been once round.
    found = np.flatnonzero(agree > _AGREE)
    found = found[found > np.argmax(agree < 0.5)]
    if not len(found) or not np.any(agree < 0.5):
        return 0.0
    near = np.linspace(found[0] - 1.0, found[0] + _FINER, 40 * (_FINER + 1)) / (_FINER * _BINS * bin_)
    lengths = np.abs(np.mean(np.exp(2j * np.pi * near[:, None] * moved), axis=1))
    best = int(np.argmax(lengths))
    if lengths[best] < _AGREE:
        return 0.0
    numbers = np.round(moved * near[best])
    return float(numbers @ moved / (numbers @ numbers))


def added_up(speeds: Array, time: Array) -> tuple[Array, float]:
    """The way [T] that `speeds` [T] make, each over the time since the row before, from zero; and the count that all its steps
    are whole numbers of, by the stamps or by the usual interval between them, to which they are rounded; zero where there is
    none."""
    for times in (np.diff(time), np.full(len(time) - 1, float(np.median(np.diff(time))))):
        steps = speeds[1:] * times
        count = count_of(steps)
        if count > 0.0:
            return np.append(0.0, count * np.cumsum(np.round(steps / count))), count
    return np.append(0.0, np.cumsum(speeds[1:] * np.diff(time))), 0.0


_GAP = 1.5
"""Usual intervals from which on a row is missing."""


def way_of(speeds: Array, time: Array, name: str, column: str, path: Path) -> tuple[Array, str]:
    """The way [T] that a measured speed adds up to, and a sentence without file and full stop on that. Raises `LogError` where
    readings are missing: how far a wheel turned there is not known."""
    absent = np.flatnonzero(~np.isfinite(speeds))
    if len(absent):
        raise LogError(
            f"{path}: {column!r} has no reading in row {absent[0]}, so that what it adds up to for {name!r} is not known from "
            "there on; cut the log there, or map the encoder's counts."
        )
    steps = np.diff(time)
    late = np.flatnonzero(steps > _GAP * np.median(steps)) if len(steps) else steps
    if len(late):
        raise LogError(
            f"{path}: rows are missing before {time[late[0] + 1]:.4g} s, so that what {column!r} adds up to for {name!r} is "
            "not known from there on; cut the log there, or map the encoder's counts."
        )
    way, count = added_up(speeds, time)
    counted = f", which is counted in steps of {count:.4g}" if count else ""
    return way, f"{name!r} is what the speed {column!r} adds up to{counted}"
