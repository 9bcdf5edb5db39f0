"""Pre-flight check of the rows: does an output answer the input of its own row, which was applied only from then on?

Programs that write a row when a command was given and its answer was read put the input beside what came of it. To every later
check and fit the motion then runs ahead of its cause: signs seem flipped, time constants vanish.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..logs.finding import Finding
from ..logs.log import Log
from .motion import even, is_position
from .samples import finding

Array = NDArray[np.float64]

_SHARE_OF_NEWS = 0.5
"""Share of an output's news that the input of its own row explains, from which on it is no chance and no noise of a speed
that was smoothed over a few samples."""
_LITTLE_NEWS = 1e-3
"""Share of an input's variance below which nothing in it is new from row to row."""
_FEWEST = 20
"""Changes of the input."""
_ROWS_BEFORE = 3


def _news(values: Array, past: Array) -> Array:
    """What of `values` [N] the `past` [N, k] does not foretell."""
    return values - past @ np.linalg.lstsq(past, values, rcond=1e-9)[0]


def check_early(log: Log) -> Iterator[Finding]:
    """Findings about outputs that change with the input of their own row, at the sign that the robot's mixing says."""
    differentiated = {found.column for found in log.findings if found.check == "differentiated"}
    if len(log) < 3 * _FEWEST:
        return
    rows = even(log)
    for name, mixing in log.channels.mixing.items():
        if name not in log.measured or name in differentiated or is_position(log, name):
            continue
        values, push = log.output(name)[rows.rows], rows.inputs @ np.asarray(mixing)
        there = np.convolve(np.isfinite(values), np.ones(_ROWS_BEFORE + 1), mode="valid") > _ROWS_BEFORE
        if np.sum(np.diff(push) != 0) < _FEWEST or there.sum() < 3 * _FEWEST:
            continue
        past = [
            signal[_ROWS_BEFORE - k : len(signal) - k] for k in range(1, _ROWS_BEFORE + 1) for signal in (values, push)
        ]
        known = np.stack([*past, np.ones(len(there))], axis=1)[there]
        own, cause = (_news(signal[_ROWS_BEFORE:][there], known) for signal in (values, push))
        together = float(cause @ own)
        if cause @ cause < _LITTLE_NEWS * np.sum((push - push.mean()) ** 2) or together <= 0 or not own @ own > 0:
            continue
        share = together**2 / float((cause @ cause) * (own @ own))
        if share > _SHARE_OF_NEWS:
            text = (
                f"changes with the input of its own row, which is applied only from then on ({share:.0%} of what is new); "
                "if rows hold a command and what came of it, move what was measured one row down; an input that was measured, "
                "and held by nobody, is a straight line between samples (`--intersample linear`)"
            )
            yield finding(log, name, None, "warning", "ahead_of_input", text)
