"""What the other logs of a set say about one: that it is another's copy, and of a sensor that looks dead in it.

A sensor that is unrelated to every input is dead, or the robot hardly moved that way: dry friction holds it against small
commands. One log alone cannot tell which. Where the sensor answers to the inputs in the other logs, the relation learned there
promises a motion in this one; and where it promises no more than what the sensor did not answer to in the other logs
either, its silence says nothing.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from .._filters import lagged
from ..logs.finding import Finding
from ..logs.log import Log
from .motion import response
from .sensors import UNRELATED

Array = NDArray[np.float64]

_ANSWERS = 0.5
"""Share of a sensor's variance, foretold by the inputs, from which it answers to them."""
_FEWEST = 100
"""Samples of another log, and of all with as small a promise, below which they say nothing about it."""


def _regressors(log: Log, seconds: float) -> Array:
    """Inputs, two first-order lags of each (of a third of `seconds` and once it), and one [T, 3 nu + 1]."""
    columns = [log.inputs]
    for constant in (seconds / 3, seconds):
        columns.append(lagged(log.inputs, float(np.exp(-log.sampling_interval / constant))))
    return np.concatenate([*columns, np.ones((len(log), 1))], axis=1)


def _share(measured: Array, promised: Array) -> float:
    """Share of the variance that the promise, by whatever factor, foretells."""
    centred, spread = promised - promised.mean(), float(np.var(measured))
    if spread == 0 or not centred.any():
        return 0.0
    return float((centred @ measured) ** 2 / (centred @ centred) / len(measured) / spread)


def _says_nothing(log: Log, name: str, others: Sequence[Log]) -> bool:
    """Whether the other logs know the sensor `name` to answer to the inputs, but not to commands as weak as those of `log`."""
    others = [other for other in others if name in other.measured and len(other) >= _FEWEST]
    if not others or name not in log.measured:
        return False
    seconds = response(log) * log.sampling_interval
    measured = np.concatenate([other.output(name) for other in others])
    regressors = np.concatenate([_regressors(other, seconds) for other in others])
    there = np.isfinite(measured)
    measured, regressors = measured[there], regressors[there]
    relation, *_ = np.linalg.lstsq(regressors, measured, rcond=None)
    promised = regressors @ relation
    weak = np.abs(promised) <= np.max(np.abs(_regressors(log, seconds) @ relation))
    if _share(measured, promised) < _ANSWERS or weak.sum() < _FEWEST:
        return False
    return _share(measured[weak], promised[weak]) < _ANSWERS


def among(logs: Sequence[Log], findings: Sequence[Sequence[Finding]]) -> Iterator[Finding]:
    """The `findings` of each of `logs`, without dead sensors that the other logs show to be none, and with copies of logs."""
    first: dict[str, str] = {}
    for log, own in zip(logs, findings, strict=True):
        name = first.setdefault(log.sha256, log.name)
        if name != log.name:
            yield _copy(log, name)
        for found in own:
            silent = found.check == "dead_sensor" and UNRELATED in found.message
            others = [other for other in logs if other is not log]
            if not (silent and found.column and _says_nothing(log, found.column, others)):
                yield found


def _copy(log: Log, first: str) -> Finding:
    message = (
        f"{log.name} holds the same numbers as {first}, and counts as a second experiment, so that standard errors come out "
        "too small; leave one of them out."
    )
    return Finding(log.name, None, None, "warning", "copy", message)
