"""What an autoregression with the inputs does not foretell of a signal from one reading to the next: no less than its noise.

Where a robot moves far between two readings, by a slow sensor or since it is quick, differences of neighbouring readings show
its motion and not their noise. A linear model of a few readings and of the inputs between them (ARX; Ljung, System
Identification, 1999, section 4.2) foretells most of that motion, of whatever robot, and leaves at least the noise: an upper
bound that needs no model of the robot.
"""

import numpy as np
from numpy.typing import NDArray

_BACK = 2
"""Readings before that foretell one."""
_BINS = 4
"""Means of every input over so many stretches between two readings, as far as there are rows."""
_EACH = 4
"""Readings to a coefficient, at least: of fewer an autoregression follows the noise."""
_MOST = 20_000
"""Readings that are looked at; more say no more."""
_FAR = 3.5
"""Robust standard deviations beyond which a reading does not count the second time."""
_SIGN = 0.02
"""Share of the largest value below which a signal counts as standing, where dry friction has no sign."""


def _stretches(inputs: NDArray[np.float64], rows: NDArray[np.int64], bins: int) -> NDArray[np.float64]:
    """Means of the inputs over so many stretches of the rows between neighbouring `rows` [K - 1, bins n]."""
    sums = np.concatenate([np.zeros((1, inputs.shape[1])), np.cumsum(inputs, axis=0)])
    edges = [rows[:-1] + np.round(np.diff(rows) * k / bins).astype(int) for k in range(bins + 1)]
    means = [(sums[b] - sums[a]) / np.maximum(b - a, 1)[:, None] for a, b in zip(edges[:-1], edges[1:], strict=True)]
    return np.concatenate(means, axis=1)


def _regression(
    values: NDArray[np.float64], inputs: NDArray[np.float64], rows: NDArray[np.int64], back: int, bins: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Regressors [n, columns] and the readings [n] that they foretell, from so many before and the inputs between them. What is
    foretold of dry friction is by the sign of the reading before."""
    usual = float(np.median(np.diff(rows)))
    # Only readings that follow one another as usual: after a gap another autoregression holds.
    even = np.abs(np.diff(rows) - usual) <= max(1.0, 0.1 * usual)
    between = _stretches(inputs, rows, bins)
    n = len(values) - back
    own = [values[back - k : back - k + n] for k in range(1, back + 1)]
    standing = np.abs(own[0]) <= _SIGN * float(np.max(np.abs(values)))
    columns = np.stack([*own, np.where(standing, 0.0, np.sign(own[0])), np.ones(n)], axis=1)
    commands = [between[back - k : back - k + n] for k in range(1, back + 1)]
    regressors, target = np.concatenate([columns, *commands], axis=1), values[back:]
    kept = np.all([even[back - k : back - k + n] for k in range(1, back + 1)], axis=0)
    kept &= np.all(np.isfinite(regressors), axis=1) & np.isfinite(target)
    regressors, target = regressors[kept], target[kept]
    size = np.linalg.norm(regressors, axis=0)
    return regressors[:, size > 0] / size[size > 0], target


def not_foretold(y: NDArray[np.float64], inputs: NDArray[np.float64], rows: NDArray[np.int64] | None = None) -> float:
    """Standard deviation of what is not foretold of a signal [T], from the readings at `rows` (all measured ones unless given)
    and the inputs [T, n] between them; infinite where there are too few readings. Each input acts from its row to the next."""
    rows = np.flatnonzero(np.isfinite(y)) if rows is None else rows
    rows = rows[:_MOST]
    if len(rows) <= _BACK + _EACH:
        return float("inf")
    finest = min(_BINS, max(int(np.median(np.diff(rows))), 1))
    for back, bins in [*((_BACK, bins) for bins in range(finest, 0, -1)), (1, 1)]:
        regressors, target = _regression(y[rows], inputs, rows, back, bins)
        if len(target) >= _EACH * regressors.shape[1]:
            return _left(regressors, target)
    return float("inf")


def _left(regressors: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    """Standard deviation of what regressors leave of the target, the coefficients counted; a few far readings do not count."""
    level = 0.0
    for _ in range(2):
        found, _, rank, _ = np.linalg.lstsq(regressors, target, rcond=1e-10)
        left = target - regressors @ found
        level = float(np.sqrt(np.sum(left**2) / max(len(target) - int(rank), 1)))
        steady = np.abs(left) <= _FAR * 1.4826 * float(np.median(np.abs(left)))
        if steady.all() or np.count_nonzero(steady) < 2 * regressors.shape[1]:
            break
        regressors, target = regressors[steady], target[steady]
    return level
