"""Pre-flight check of direction: inputs lead and outputs follow. Where an input follows an output that nothing leads, the two
columns are exchanged.

One signal leads another if its past foretells the other better than the other's own past does (C. W. J. Granger, Econometrica
37, 1969). In an open loop inputs lead outputs; in a closed loop each leads the other, and nothing is said.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..logs.finding import Finding
from ..logs.log import Log
from .motion import even, is_position
from .samples import finding, quantum

Array = NDArray[np.float64]

_PAST = 3
"""Values of the past that foretell: enough for a speed and an acceleration."""
_FEWEST = 100
"""Means over stretches below which a share says little."""
_LED = 0.3
"""Share of an input's news that an output has to foretell."""
_ANSWERED = 1 / 3
"""Share of that output's own news that the inputs may foretell at most, over that."""


def _past(signals: Array) -> Array:
    """The last values of `signals [N, n]` before each of the rows `_PAST ...`, `[N - _PAST, n * _PAST]`."""
    return np.concatenate([signals[_PAST - 1 - k : len(signals) - 1 - k] for k in range(_PAST)], axis=1)


def _news(target: Array, past: Array) -> tuple[float, int]:
    """Sum of squares that a linear regression on `past` leaves of `target`, and its number of columns."""
    size = past.std(axis=0)
    columns = np.concatenate(
        [(past - past.mean(axis=0))[:, size > 0] / size[size > 0], np.ones((len(past), 1))], axis=1
    )
    basis, strength, _ = np.linalg.svd(columns, full_matrices=False)
    basis = basis[:, strength > 1e-9 * strength[0]]
    left = target - basis @ (basis.T @ target)
    return float(left @ left), basis.shape[1]


def _foretold(target: Array, known: Array, more: Array) -> float:
    """Share of what the past of `target [N]` and of `known [N, n]` leaves of it that the past of `more [N, m]` foretells,
    chance taken off; 0 where nothing but rounding is left."""
    own = _past(np.concatenate([target[:, None], known], axis=1))
    now = target[_PAST:] - target[_PAST:].mean()
    rounding = 1e-10 * float(now @ now)
    without, few = _news(now, own)
    with_more, many = _news(now, np.concatenate([own, _past(more)], axis=1))
    if without <= rounding:
        return 0.0
    return 1.0 - max(with_more, rounding) / (len(now) - many) * (len(now) - few) / without


def _means(signals: Array, width: int) -> Array:
    """Means over stretches of `width` samples: what noise hides from sample to sample shows there."""
    rows = len(signals) // width * width
    return signals[:rows].reshape(-1, width, signals.shape[1]).mean(axis=1)


def _held(values: Array) -> Array:
    """Values that were not measured, `[N]`, as the last measured one: in between would know the next one already."""
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), -1))
    return np.where(last >= 0, values[last], values[np.isfinite(values)][0])


def _commanded(values: Array, position: bool) -> bool:
    """Whether a signal is surely a command: held most of the time, then changed by much, and not from one level to the next
    as an encoder's counts are. What a controller does follows a sensor, so that in its loop the inputs seem to be led; and
    no sensor looks like this."""
    changes = np.abs(np.diff(values))
    changed = changes[changes > 0]
    if not len(changed) or len(changed) > len(changes) / 3 or np.median(changed) < 0.1 * np.std(values):
        return False
    step = quantum(values)
    return not (step > 0 and (position or np.mean(changed < 1.5 * step) > 0.8 and np.ptp(values) > 1.5 * step))


def _doubtful(log: Log) -> list[str]:
    """Outputs, and what stands in for them, that look like commands."""
    names = dict.fromkeys((*log.channels.outputs, *log.channels.positions))
    there = [name for name in names if name in log.measured and np.isfinite(log.output(name)).any()]
    return [name for name in there if _commanded(_held(log.output(name)), is_position(log, name))]


def check_exchanged(log: Log) -> Iterator[Finding]:
    """At most one finding: the input and the output whose columns stand in each other's place."""
    outputs = _doubtful(log)
    rows = even(log)
    driven = [i for i in range(rows.inputs.shape[1]) if np.ptp(rows.inputs[:, i]) > 0]
    if not outputs or not driven or len(rows.rows) < _FEWEST:
        return
    inputs, names = rows.inputs[:, driven], [log.channels.inputs[i] for i in driven]
    seen = np.stack([_held(log.output(name))[rows.rows] for name in outputs], axis=-1)
    led = np.zeros((len(names), len(outputs)))  # share of the input's news that the output foretells
    answers = np.zeros(len(outputs))  # share of the output's news that the inputs foretell
    width = 1
    while len(seen) // width >= _FEWEST:
        u, y = _means(inputs, width), _means(seen, width)
        for j in range(len(outputs)):
            answers[j] = max(answers[j], _foretold(y[:, j], y[:, :0], u))
            for i in range(len(names)):
                led[i, j] = max(led[i, j], _foretold(u[:, i], np.delete(u, i, axis=1), y[:, [j]]))
        width *= 3
    apart = np.where((led >= _LED) & (answers <= _ANSWERED * led), led - answers, 0.0)
    if not apart.any():
        return
    i, j = np.unravel_index(np.argmax(apart), apart.shape)
    text = (
        f"output {outputs[j]!r} foretells {led[i, j]:.0%} of what is new in this input, and the inputs {answers[j]:.0%} of "
        "what is new in that output, where a command leads and a sensor follows: the two columns look exchanged; exchange "
        "their names (a mapping does), or look for a clock of the outputs that runs ahead"
    )
    yield finding(log, names[i], None, "warning", "exchanged", text)
