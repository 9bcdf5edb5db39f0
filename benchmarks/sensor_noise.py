"""Noise as sensors make it: what the study of false alarms adds to the exact outputs of a simulation.

Every kind is a function of a random generator and the exact outputs of one log, with a size [ny] that its standard deviation
is to have, and returns the measured outputs.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Array = NDArray[np.float64]
_BEFORE = 400
"""Samples that a filter runs before a log begins, so that its noise is stationary from the first one on."""


@dataclass(frozen=True)
class Exact:
    """One log without noise: `time` [T], `outputs` [T, ny] and their slopes; `number` is its place among all logs."""

    time: Array
    outputs: Array
    number: int

    @property
    def slopes(self) -> Array:
        """Rate of change of the outputs [T, ny] per second, by central differences."""
        return np.gradient(self.outputs, self.time, axis=0)


Make = Callable[[np.random.Generator, Exact, Array], Array]


def _filtered(numerator, denominator) -> Make:
    """Gaussian noise through a filter, scaled to the size asked for."""
    response = np.asarray(signal.lfilter(numerator, denominator, np.eye(1, 4096)[0]))
    gain = float(np.sqrt(np.sum(response**2)))

    def make(rng, exact, size):
        white = rng.normal(size=(len(exact.time) + _BEFORE, len(size)))
        return exact.outputs + size * signal.lfilter(numerator, denominator, white, axis=0)[_BEFORE:] / gain

    return make


def _first_order(pole: float) -> Make:
    return _filtered([1.0], [1.0, -pole])


def _average(width: int) -> Make:
    return _filtered(np.ones(width), [1.0])


def _low_pass(share: float) -> Make:
    """A second-order Butterworth filter, its cut-off a share of half the sampling rate."""
    numerator, denominator = np.asarray(signal.butter(2, share))
    return _filtered(numerator, denominator)


def _shaped(draw: Callable[[np.random.Generator, tuple[int, int]], Array]) -> Make:
    """Independent samples of a distribution of unit variance."""

    def make(rng, exact, size):
        return exact.outputs + size * draw(rng, exact.outputs.shape)

    return make


def _normal(rng, shape):
    return rng.normal(size=shape)


def _with_outliers(inner: Make) -> Make:
    """One sample in a hundred is off by another 5 to 30 standard deviations."""

    def make(rng, exact, size):
        outputs = inner(rng, exact, size)
        far = size * rng.choice([-1.0, 1.0], outputs.shape) * rng.uniform(5, 30, outputs.shape)
        return outputs + np.where(rng.random(outputs.shape) < 0.01, far, 0.0)

    return make


def _rounded(steps: float, inner: Make | None = None) -> Make:
    """Rounded to multiples of a step of so many standard deviations of the noise `inner`; without any, to a step whose rounding
    has the size asked for."""

    def make(rng, exact, size):
        step = size * (steps if inner else np.sqrt(12.0))
        before = inner(rng, exact, size) if inner else exact.outputs
        return np.round(before / step) * step

    return make


def _counted(rng, exact, size):
    """Speeds from differences of a counter: each sample has the rounding of this count and, the other way, of the last one."""
    interval = np.diff(exact.time, prepend=2 * exact.time[0] - exact.time[1])[:, None]
    step = size * np.sqrt(6.0) * float(np.median(interval))
    travelled = np.cumsum(exact.outputs * interval, axis=0)
    rounding = np.round(travelled / step) * step - travelled
    return exact.outputs + np.diff(rounding, axis=0, prepend=0.0) / interval


def _missing(inner: Make) -> Make:
    """Five samples in a hundred are not there."""

    def make(rng, exact, size):
        outputs = inner(rng, exact, size)
        outputs[rng.random(outputs.shape) < 0.05] = np.nan
        return outputs

    return make


def _late_or_early(share: float) -> Make:
    """Sampled up to this share of an interval before or after what the stamp says, and with white noise."""

    def make(rng, exact, size):
        interval = float(np.median(np.diff(exact.time)))
        off = rng.uniform(-share, share, (len(exact.time), 1)) * interval
        return exact.outputs + exact.slopes * off + size * rng.normal(size=exact.outputs.shape)

    return make


def _by_log(inner: Make) -> Make:
    """Another size in every log: a half to three times the usual one."""

    def make(rng, exact, size):
        return inner(rng, exact, size * float(np.exp(rng.uniform(np.log(0.5), np.log(3.0)))))

    return make


_white = _shaped(_normal)

KINDS: dict[str, Make] = {
    "white": _white,
    "first order, 0.5": _first_order(0.5),
    "first order, 0.8": _first_order(0.8),
    "first order, 0.9": _first_order(0.9),
    "average of 4": _average(4),
    "low-pass, a fifth": _low_pass(0.2),
    "rounded, fine": _rounded(1.0, _white),
    "rounded, coarse": _rounded(4.0, _white),
    "rounded, no noise": _rounded(0.0),
    "counted": _counted,
    "Student, 3": _shaped(lambda rng, shape: rng.standard_t(3, shape) / np.sqrt(3.0)),
    "Laplace": _shaped(lambda rng, shape: rng.laplace(size=shape) / np.sqrt(2.0)),
    "outliers": _with_outliers(_white),
    "jitter, a tenth": _late_or_early(0.1),
    "missing": _missing(_white),
    "by log": _by_log(_white),
    "first order, 0.8, by log": _by_log(_first_order(0.8)),
    "first order, 0.8, rounded": _rounded(1.0, _first_order(0.8)),
    "first order, 0.8, missing": _missing(_first_order(0.8)),
    "first order, 0.8, outliers": _with_outliers(_first_order(0.8)),
}
"""What a sensor may add, by name."""

FAMILIES = {
    "white": ("white",),
    "coloured": ("first order, 0.5", "first order, 0.8", "first order, 0.9", "average of 4", "low-pass, a fifth"),
    "quantised": ("rounded, fine", "rounded, coarse", "rounded, no noise", "counted"),
    "heavy-tailed": ("Student, 3", "Laplace"),
    "outliers": ("outliers",),
    "jittered": ("jitter, a tenth",),
    "missing": ("missing",),
    "different by log": ("by log",),
    "two at a time": tuple(f"first order, 0.8, {other}" for other in ("by log", "rounded", "missing", "outliers")),
}
"""The kinds by what is odd about them."""
