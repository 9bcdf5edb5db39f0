"""Kinds of measurement noise, each of unit variance (quantisation and outliers beside white noise, as they come).

`white` draws exactly what `numpy`'s standard normal draws. Stamps that jitter are no noise of the speeds: see `jittered`.
"""

import numpy as np
from scipy.signal import lfilter

KINDS = ("white", "coloured", "quantised", "heavy_tailed", "outliers", "jittered")
POLE = 0.8  # of the coloured noise, AR(1)
STEP = 3.0  # of quantised readings, in standard deviations of the noise below it
DEGREES = 3.5  # of freedom of the heavy tails (Student's t)
OUTLIERS, SIZE = 0.01, 12.0  # share of the samples, and their standard deviation
JITTER = 0.05  # of stamps, in sampling intervals


def added(speeds: np.ndarray, sigma: np.ndarray, kind: str, rng: np.random.Generator) -> np.ndarray:
    """Speeds (N, n_v) as read, with noise of standard deviations `sigma` (n_v,) of a kind of `KINDS`.

    Quantised readings are rounded to `STEP` sigma and have little noise below; their error's variance is sigma^2 about.
    Raises ValueError for an unknown kind.
    """
    if kind not in KINDS:
        raise ValueError(f"Unknown kind of noise '{kind}'; choose from {', '.join(KINDS)}.")
    white = rng.standard_normal(speeds.shape)
    if kind == "coloured":
        start = POLE * rng.standard_normal((1, speeds.shape[1]))
        white = lfilter([np.sqrt(1.0 - POLE**2)], [1.0, -POLE], white, axis=0, zi=start)[0]
    elif kind == "heavy_tailed":
        white = rng.standard_t(DEGREES, speeds.shape) / np.sqrt(DEGREES / (DEGREES - 2.0))
    elif kind == "outliers":
        hit = rng.uniform(size=speeds.shape) < OUTLIERS
        white = white + hit * SIZE * rng.standard_normal(speeds.shape)
    elif kind == "quantised":
        step = STEP * sigma
        return step * np.round((speeds + 0.3 * sigma * white) / step)
    return speeds + white * sigma


def jittered(time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Stamps (N,) that miss the times of the samples by `JITTER` sampling intervals, and stay in order; the first is right."""
    interval = np.diff(time).min()
    errors = np.clip(rng.standard_normal(time.size) * JITTER, -0.4, 0.4)
    errors[0] = 0.0
    return time + interval * errors
