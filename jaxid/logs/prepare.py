"""The paper's preparation of logs: remove outliers, remove linear trends, filter without phase shift.

Innocenti et al. prepare their logs so before integral least squares. Nothing in jaxid does it unasked: a filter colours
the noise that the estimators weigh with, and a trend may be physics. `prepare` therefore reports what it took away.
Speeds that are filtered while voltages are not answer every step too slowly, and the robot comes out too heavy; inputs
are therefore filtered alike. Dry friction still changes sign at once, and not as filtered speeds would have it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import overload

import numpy as np
import scipy
from numpy.typing import NDArray

from .finding import LogError
from .log import Log, LogSet

Array = NDArray[np.float64]

_HALF_WIDTH = 3  # samples to either side of Hampel's window
_THRESHOLD = 4.0  # robust standard deviations
_ORDER = 4  # of the Butterworth filter, before its second pass


@dataclass(frozen=True)
class Removed:
    """What `prepare` removed from one column of one log.

    - `outliers`: sample indices whose value was replaced by the median around it.
    - `slope`: linear trend taken out [unit/s].
    - `noise_power`: mean square of what the filter took out [unit^2]: the power above the cut-off.
    """

    outliers: tuple[int, ...] = ()
    slope: float = 0.0
    noise_power: float = 0.0

    def __str__(self) -> str:
        return (
            f"{len(self.outliers)} outlier(s), trend {self.slope:.4g} per s, power above cut-off {self.noise_power:.4g}"
        )


Report = Mapping[str, Mapping[str, Removed]]


def _without_outliers(values: Array) -> tuple[Array, tuple[int, ...]]:
    """Hampel's filter: a sample more than four robust deviations off the median of the seven around it becomes that
    median. The scale is the larger of the window's own and the whole column's, so that a quantised or quiet stretch
    does not turn every small change into an outlier.
    """
    width = 2 * _HALF_WIDTH + 1
    if len(values) < width:
        return values, ()
    middle = scipy.ndimage.median_filter(values, size=width, mode="nearest")
    off = np.abs(values - middle)
    scale = 1.4826 * np.maximum(scipy.ndimage.median_filter(off, size=width, mode="nearest"), np.median(off))
    # A column without noise has scale 0 almost everywhere; a bend in it is no outlier.
    least = 0.02 * np.ptp(np.quantile(values, [0.01, 0.99]))
    found = np.flatnonzero((off > _THRESHOLD * scale) & (off > least))
    cleaned = values.copy()
    cleaned[found] = middle[found]
    return cleaned, tuple(int(k) for k in found)


def _column(
    time: Array, values: Array, name: str, outliers: bool, trends: bool, sos: Array | None
) -> tuple[Array, Removed]:
    there = np.isfinite(values)
    removed = Removed()
    if not there.any():
        return values, removed
    known = values[there]
    if outliers:
        known, found = _without_outliers(known)
        removed = replace(removed, outliers=tuple(int(np.flatnonzero(there)[k]) for k in found))
    if trends and len(known) > 2:
        centred = time[there] - time[there].mean()
        slope = float(centred @ known / (centred @ centred))
        # The paper's runs start at rest: the line is taken out from the first sample on, and the start stays at zero.
        known = known - slope * (time[there] - time[there][0])
        removed = replace(removed, slope=slope)
    if sos is not None:
        if not there.all():
            raise LogError(
                f"{name} has samples that were not measured, across which no filter runs; cut the log there."
            )
        if len(known) <= 3 * (2 * len(sos) + 1):
            raise LogError(f"{name} has {len(known)} samples, too few for the filter; leave cutoff_hz out.")
        smooth = scipy.signal.sosfiltfilt(sos, known)
        removed = replace(removed, noise_power=float(np.mean((known - smooth) ** 2)))
        known = smooth
    result = values.copy()
    result[there] = known
    return result, removed


def _one(log: Log, outliers: bool, trends: bool, cutoff_hz: float | None) -> tuple[Log, dict[str, Removed]]:
    sos = None
    if cutoff_hz is not None:
        nyquist = 0.5 / log.sampling_interval
        if not 0 < cutoff_hz < nyquist:
            raise LogError(
                f"{log.name}: a cut-off of {cutoff_hz:g} Hz does not lie between 0 and {nyquist:.4g} Hz; change it."
            )
        uneven = np.max(np.abs(np.diff(log.time) / log.sampling_interval - 1))
        if uneven > 0.1:
            raise LogError(
                f"{log.name}: sampling intervals differ by {uneven:.0%}, across which no filter runs; resample or cut "
                "it."
            )
        sos = np.asarray(scipy.signal.butter(_ORDER, cutoff_hz, fs=1 / log.sampling_interval, output="sos"))
    outputs = log.outputs.copy()
    report = {}
    for name in log.measured:
        j = log.channels.measured.index(name)
        label = f"{log.name}: output {name!r}"
        outputs[:, j], report[name] = _column(log.time, log.outputs[:, j], label, outliers, trends, sos)
    if sos is None:
        return replace(log, outputs=outputs), report
    inputs = log.inputs.copy()
    for j, name in enumerate(log.channels.inputs):
        label = f"{log.name}: input {name!r}"
        inputs[:, j], report[name] = _column(log.time, log.inputs[:, j], label, False, False, sos)
    return replace(log, inputs=inputs, outputs=outputs), report


@overload
def prepare(
    logs: Log, outliers: bool = ..., trends: bool = ..., cutoff_hz: float | None = ...
) -> tuple[Log, Report]: ...
@overload
def prepare(
    logs: LogSet, outliers: bool = ..., trends: bool = ..., cutoff_hz: float | None = ...
) -> tuple[LogSet, Report]: ...
def prepare(
    logs: Log | LogSet, outliers: bool = True, trends: bool = True, cutoff_hz: float | None = None
) -> tuple[Log | LogSet, Report]:
    """Clean the measured columns and report what was removed; inputs, which are known, are only ever filtered.

    - `outliers`: Hampel's filter over seven samples, four robust standard deviations.
    - `trends`: take out the straight line fitted to each column, from the first sample on (sensor drift; take care, a
      log that speeds up throughout has a trend that is no drift).
    - `cutoff_hz`: low-pass with a fourth-order Butterworth run forward and backward (no phase shift), of inputs
      and outputs alike, so that linear equations between them still hold.

    Returns the new log (or set) and `{log name: {column: Removed}}`. Raises `LogError` for a cut-off outside (0, half
    the sampling frequency), and for filtering across uneven sampling or samples that were not measured.
    """
    if isinstance(logs, Log):
        log, report = _one(logs, outliers, trends, cutoff_hz)
        return log, {log.name: report}
    done = [_one(log, outliers, trends, cutoff_hz) for log in logs]
    return LogSet(log for log, _ in done), {log.name: report for log, report in done}
