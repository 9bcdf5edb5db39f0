"""Incremental encoders: counts of exact angles, seen late, averaged or behind a filter.

Angles are given on a fine grid of equal steps; whatever happens to them on their way to the log happens there, before they
are counted.
"""

import numpy as np
from scipy.signal import lfilter

Angles = np.ndarray


def late(angles: Angles, steps: int) -> Angles:
    """Angles (N, wheels) as they were `steps` rows before; at the start as they are there."""
    return angles[np.maximum(np.arange(len(angles)) - steps, 0)]


def low_passed(angles: Angles, time_constant: float) -> Angles:
    """Angles behind a first-order filter of `time_constant`, in rows, that has settled at the start; exact for angles that
    are straight lines between rows."""
    kept = np.exp(-1.0 / time_constant)
    share = time_constant * (1.0 - kept)
    turned = angles - angles[0]
    return angles[0] + lfilter([1.0 - share, share - kept], [1.0, -kept], turned, axis=0)


def averaged(angles: Angles, before: int, after: int = 0) -> Angles:
    """The mean of the angles, straight lines between rows, over `before` rows before and `after` after each; beyond the ends
    as they are there."""
    padded = np.concatenate([np.repeat(angles[:1], before, axis=0), angles, np.repeat(angles[-1:], after, axis=0)])
    area = np.concatenate([np.zeros((1, angles.shape[1])), np.cumsum(0.5 * (padded[1:] + padded[:-1]), axis=0)])
    return (area[before + after :] - area[: len(angles)]) / (before + after)


def counted(angles: Angles, counts: float, rng: np.random.Generator, turn: float = 2 * np.pi) -> Angles:
    """Angles as an encoder of `counts` per turn (`turn` in their unit) counts them down, from wherever each stood."""
    step = turn / counts
    return step * np.floor((angles + rng.uniform(-50.0, 50.0, angles.shape[1])) / step)
