"""Does a missing force swing by itself, in a band of frequencies that what drove the robot does not dwell in?"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_BAND = 1.2
"""Highest frequency of a band over its middle one, and this over the lowest."""
_FEWEST = 4
"""Periods in the shortest log from which a swing can be told from a slow change."""
_BANDS, _DRAWS, _SEED = 60, 400, 23


class Swing(NamedTuple):
    """`share` of the force's power in the band about `period` [s], the `p_value` of a force with the spectrum of what drove the
    robot having as much in any band, and the `part` of every log's force [T, n] in the band."""

    period: float
    share: float
    p_value: float
    part: tuple[NDArray[np.float64], ...]


def swing(
    forces: Sequence[NDArray[np.float64]], drove: Sequence[NDArray[np.float64]], times: Sequence[NDArray[np.float64]]
) -> Swing | None:
    """The band that holds most of the `forces` [T, n] of all logs, beside what `drove` the robot [T, k] in them; None where
    logs are too short to tell, or nothing drove it."""
    intervals = [float(np.median(np.diff(time))) for time in times]
    lowest = _FEWEST / min(time[-1] - time[0] for time in times)
    highest = 0.25 / max(intervals)
    whole = sum(float(np.sum(force**2)) for force in forces)
    if not (highest > lowest * _BAND and whole > 0):
        return None
    middles = np.asarray(np.geomspace(lowest, highest, _BANDS))
    # Of each log: frequencies [F], and powers of the force and of what drove it [F].
    at = [np.fft.rfftfreq(len(force), dt) for force, dt in zip(forces, intervals, strict=True)]
    inside = [(np.abs(np.log(np.maximum(f, 1e-12)[:, None] / middles)) < np.log(_BAND)).astype(float) for f in at]
    power = [_power(force) for force in forces]
    in_band = np.sum([own @ band for own, band in zip(power, inside, strict=True)], axis=0)
    shares = in_band / float(np.sum([own.sum() for own in power]))
    rng, like = np.random.default_rng(_SEED), [_power(own) for own in drove]
    if not sum(own.sum() for own in like) > 0:
        return None
    drawn = [own * rng.exponential(size=(_DRAWS, len(own))) for own in like]
    in_band = np.sum([own @ band for own, band in zip(drawn, inside, strict=True)], axis=0)
    chance = in_band / np.sum([own.sum(axis=1) for own in drawn], axis=0)[:, None]
    best = int(np.argmax(shares))
    largest = chance.max(axis=1)
    parts = []
    for force, f in zip(forces, at, strict=True):
        band = np.abs(np.log(np.maximum(f, 1e-12) / middles[best])) < np.log(_BAND)
        parts.append(np.fft.irfft(np.fft.rfft(force, axis=0) * band[:, None], len(force), axis=0))
    share = float((shares[best] - largest.mean()) / max(1.0 - largest.mean(), 1e-9))
    p_value = float((1.0 + np.count_nonzero(largest >= shares[best])) / (1.0 + _DRAWS))
    return Swing(1.0 / float(middles[best]), share, p_value, tuple(parts))


def _power(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Power of all columns together by frequency [F], the mean left out."""
    found = np.sum(np.abs(np.fft.rfft(values, axis=0)) ** 2, axis=1)
    found[0] = 0.0
    return found
