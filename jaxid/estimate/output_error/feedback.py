"""Whether a log was recorded in a closed loop: does the input follow what the model does not explain of the output?

In an open loop the noise and the disturbances of the output, the residual e = measured - simulated, know nothing of the
inputs to come. A controller feeds them back. So the input, as far as its own past does not foretell it, is regressed
on past residuals (Ljung, System Identification, 1999, section 13.4; Granger's test of e on u).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._distributions import f_tail
from ...logs import Log, LogSet
from ...simulation.simulate import integrator_for, simulate
from ..result import Fit

Array = NDArray[np.float64]
_OWN, _OTHER = 30, 6
"""Past samples of the input, and of the residuals, that are looked at."""
_SHARE, _CHANCE = 0.02, 1e-6
"""Least share explained, and largest p-value, for a closed loop."""
_FEW = 8
"""Values that an input takes in all logs up to which nobody made them of a measured signal: a sequence of levels, whose next
change an output that is logged early foretells as well."""


@dataclass(frozen=True)
class Feedback:
    """`share` of what is new in the input `name` at a sample that residuals up to that sample explain; `p_value`."""

    name: str
    share: float
    p_value: float

    @property
    def closed(self) -> bool:
        """Whether the loop is closed beyond doubt."""
        return self.share > _SHARE and self.p_value < _CHANCE


def _lagged(x: Array, first: int, lags: range) -> Array:
    return np.stack([x[first - lag : len(x) - lag] for lag in lags], axis=1)


def feedback(inputs: Sequence[Array], residuals: Sequence[Array], name: str = "u") -> Feedback:
    """Test of one input ([T] of each log) against residuals ([T, ny] of each log, NaN where not measured).

    The residual at a sample counts as known to the input of that sample, which is applied from then on.
    """
    if len(np.unique(np.concatenate([np.unique(u) for u in inputs]))) <= _FEW:
        return Feedback(name, 0.0, 1.0)
    rows, targets = [], []
    for u, e in zip(inputs, residuals, strict=True):
        if len(u) <= _OWN + 1:
            continue
        e = e[:, np.isfinite(e).any(axis=0)]
        own = _lagged(u, _OWN, range(1, _OWN + 1))
        other = [_lagged(column, _OWN, range(_OTHER)) for column in e.T]
        row = np.concatenate([np.ones((len(own), 1)), own, *other], axis=1)
        good = np.isfinite(row).all(axis=1)
        rows.append(row[good])
        targets.append(u[_OWN:][good])
    if not rows:
        return Feedback(name, 0.0, 1.0)
    X, y = np.concatenate(rows), np.concatenate(targets)
    scale = np.linalg.norm(X, axis=0)
    X = X / np.where(scale > 0, scale, 1.0)
    known = X[:, : _OWN + 1]
    extra = X.shape[1] - known.shape[1]
    freedom = len(y) - X.shape[1]
    if freedom < 3 * X.shape[1] or not np.std(y) > 0 or not extra:
        return Feedback(name, 0.0, 1.0)

    def left(A: Array) -> float:
        # Rank by relative size: lags of a smooth signal are nearly, not wholly, dependent.
        found = np.linalg.lstsq(A, y, rcond=1e-13)[0]
        return float(np.sum((y - A @ found) ** 2))

    before, after = left(known), left(X)
    if not before > 1e-20 * float(y @ y):
        return Feedback(name, 0.0, 1.0)
    after = min(after, before)
    share = 1.0 - after / before
    statistic = (before - after) / extra / max(after / freedom, np.finfo(float).tiny)
    return Feedback(name, share, float(f_tail(statistic, extra, freedom)))


def closed(logs: Sequence[Log], residuals: Sequence[Array], inputs: Sequence[str]) -> bool:
    """Whether any of the `inputs` of the logs follows their `residuals` ([T, ny] of each, NaN where not measured) beyond
    doubt."""
    return any(feedback([log.input(name) for log in logs], residuals, name).closed for name in inputs)


def fed_back(fit: Fit | None, logs: LogSet) -> Feedback:
    """The input that most plainly follows the outputs, by the residuals of `fit`, or the outputs themselves."""
    outputs = [np.array(log.outputs) for log in logs]
    if fit is not None and fit.window is None:
        seen = simulate(fit.robot, logs, integrator=integrator_for(fit.robot, logs))
        if all(np.isfinite(y).all() for y in seen):
            outputs = [y - s for y, s in zip(outputs, seen, strict=True)]
    found = [feedback([log.input(name) for log in logs], outputs, name) for name in logs.channels.inputs]
    return max(found, key=lambda f: (f.closed, f.share))
