"""The measurement noise, estimated from the data alone.

Third differences remove what is smooth over four samples and leave white noise amplified by sqrt(20). Samples around a
change of the input are left out where enough remain, since a motion has a kink there. The estimate needs no model, so a
model's residual can be judged by it; noise that is correlated over several samples is underestimated.
"""

import numpy as np
from numpy.typing import NDArray

from .log import Log, LogSet

_GAIN = np.sqrt(20.0)  # sum of squares of the stencil 1, -3, 3, -1

_SPIKE = 3.5
_KEPT = 0.99693  # root of 1 - 2 z phi(z) / (2 Phi(z) - 1) at z = 3.5


def _differences(y: NDArray[np.float64], inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Third differences of one channel, those across an input change dropped where that leaves at least 60."""
    third = y[:-3] - 3 * y[1:-2] + 3 * y[2:-1] - y[3:]
    finite = np.isfinite(third)
    change = np.any(np.diff(inputs, axis=0) != 0, axis=1)
    calm = ~(change[:-2] | change[1:-1])  # a kink at one of the two inner samples
    kept = third[finite & calm]
    return kept if kept.size >= 60 else third[finite]


def noise_level(logs: LogSet | Log) -> dict[str, float]:
    """Standard deviation of the measurement noise of each measured channel, NaN for a channel no log holds.

    The root mean square over the logs of differences within 3.5 robust standard deviations (median absolute deviation),
    so that a spike does not count. A channel whose differences are mostly zero (quantised, or at rest) falls back to
    their plain root mean square.
    """
    each = [logs] if isinstance(logs, Log) else list(logs)
    levels: dict[str, float] = {}
    for index, channel in enumerate(each[0].channels.measured):
        squares, counts = 0.0, 0
        for log in each:
            differences = _differences(log.outputs[:, index], log.inputs)
            if differences.size < 8:
                continue
            robust = 1.4826 * float(np.median(np.abs(differences)))
            if robust < 1e-9 * float(np.max(np.abs(differences))):
                robust = 0.0  # quantised: what is left is the rounding of the decimal steps
            usual = differences[np.abs(differences) < _SPIKE * robust] if robust > 0 else differences
            # Among normal numbers the mean square of those within the limit is a little below the variance.
            level = float(np.sqrt(np.mean(usual**2))) / _GAIN / (_KEPT if robust > 0 else 1.0)
            squares += differences.size * level**2
            counts += differences.size
        levels[channel] = float(np.sqrt(squares / counts)) if counts else float("nan")
    return levels
