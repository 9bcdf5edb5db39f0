"""Logs cut into windows, each a log of its own that starts in motion.

What a long simulation cannot follow, many short ones can: a pendulum that swings over the top, a plant that is unstable
without its controller, a position that drifts with every disturbance (multiple shooting without continuity; Bock, Numerical
Treatment of Inverse Problems, 1983).
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from .finding import LogError
from .log import Log, LogSet

FEWEST_SAMPLES = 3
"""Samples of the shortest window that a window may have."""


def window_rows(log: Log, seconds: float) -> list[slice]:
    """The rows of each window of a log: as equal as its samples allow, none left out at the end.

    Windows with fewer than three measured samples are dropped. Raises `LogError` if none remains.
    """
    if isinstance(seconds, str) or not seconds > 0:
        raise LogError(f"windows of {seconds!r} s cannot be cut; give a positive length in seconds.")
    wanted = round(len(log) * log.sampling_interval / seconds) if seconds < log.duration else 1
    number = max(1, min(wanted, len(log) // FEWEST_SAMPLES))
    parts = np.array_split(np.arange(len(log)), number)
    rows = [slice(int(part[0]), int(part[-1]) + 1) for part in parts]
    names = {*log.channels.outputs, *log.channels.positions}
    counted = np.isfinite(np.stack([log.output(name) for name in names], axis=1))
    kept = [k for k in rows if counted[k].sum(axis=0).max() >= FEWEST_SAMPLES]
    kept = [k for k in kept if _judged(log, counted[k], tuple(names))]
    if not kept:
        raise LogError(
            f"{log.name}: no window of {seconds:.4g} s holds {FEWEST_SAMPLES} measured samples; use longer ones."
        )
    return kept


def _judged(log: Log, counted: np.ndarray, names: tuple[str, ...]) -> bool:
    """Whether every output, or its substitute, is measured somewhere in a window."""
    there = {name for name, column in zip(names, counted.T, strict=True) if column.any()}
    return all(name in there or log.channels.stood_in(name, there) for name in log.channels.outputs)


class Windows(LogSet):
    """Logs that were cut out of `whole` ones, in windows of `seconds`."""

    def __init__(self, logs: Iterable[Log], whole: LogSet, seconds: float):
        super().__init__(logs)
        self.whole, self.seconds = whole, seconds


def in_windows(logs: LogSet, seconds: float) -> Windows:
    """Every log cut into windows of about `seconds` [s], named `log[first:last]` by their times.

    No sample is used twice; the windows of a log differ by one sample at most. A log that is no longer than a window
    stays as it is. Raises `LogError` for a length that is not positive, and for a log without measured samples.
    """
    windows = []
    for log in logs:
        rows = window_rows(log, seconds)
        if len(rows) == 1 and rows[0] == slice(0, len(log)):
            windows.append(log)
            continue
        for k in rows:
            name = f"{log.name}[{log.time[k.start]:.9g}:{log.time[k.stop - 1]:.9g}]"
            own = log.time[k], log.inputs[k], log.outputs[k]
            windows.append(Log(name, *own, log.channels, source=log.source, cut=True))
    return Windows(windows, logs, seconds)


def stitched(logs: LogSet, seconds: float, parts: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Values [n, k] of every window of `logs`, in their order, as [T, k] of every log; NaN where there is no window."""
    found, e = [], 0
    for log in logs:
        whole = np.full((len(log), parts[0].shape[-1]), np.nan)
        for k in window_rows(log, seconds):
            whole[k] = parts[e][: k.stop - k.start]
            e += 1
        found.append(whole)
    return found


def bridged(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values [T, k] with rows that are NaN throughout interpolated."""
    there = np.flatnonzero(~np.isnan(values).all(axis=1))
    if len(there) in (0, len(values)):
        return values
    return np.stack([np.interp(np.arange(len(values)), there, column[there]) for column in values.T], axis=1)
