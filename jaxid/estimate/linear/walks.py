"""The way between the samples: positions rebuilt from measured speeds, and how these speeds bend.

A walk goes from sample to sample, so that only different logs run side by side in the lanes of a processor: those of
several sets at once, where the same robot is to be asked about all of them.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel.machine import lanes
from .balance import Balance
from .log_rows import Rows

Array = NDArray[np.float64]
SUBSTEPS = 4
"""Of one sample; the caster turns with time constants down to d / eta1, about one sample."""
NODES = 2 * SUBSTEPS + 1
_NUMBERS, _FEWEST = 1_000_000, 256
"""Numbers of a walk's tables at a time, which bounds their memory, and samples at least."""


class Walk(NamedTuple):
    """Of N rows: `places` [N, NODES, nk], positions at the nodes of every interval, and `bends` [N, nv] of the speeds."""

    places: Array
    bends: Array


def at(function, p: Array, *columns: Array) -> Array:
    """A function of the machine code at points [..., n]."""
    shape = np.broadcast_shapes(*(c.shape[:-1] for c in columns))
    wide = np.concatenate([np.broadcast_to(c, (*shape, c.shape[-1])) for c in columns], axis=-1)
    found = function(p, wide.reshape(-1, 1, wide.shape[-1]), np.zeros((int(np.prod(shape)), 0)))
    return found.reshape(*shape, found.shape[-1])


def walks(code: Balance, p: Array, each: Sequence[Rows], bent: bool) -> list[Walk]:
    """A walk for each set of rows; with speeds that are `bent` between samples, or straight."""
    straight = [np.zeros_like(rows.speeds) for rows in each]
    places = _places(code, p, each, straight)
    if not bent:
        return list(map(Walk, places, straight))
    bends = [_bends(code, p, rows, own) for rows, own in zip(each, places, strict=True)]
    return list(map(Walk, _places(code, p, each, bends), bends))


def _bends(code: Balance, p: Array, rows: Rows, places: Array) -> Array:
    """The input is held, so the speeds bend by what the model's acceleration changes over the interval."""
    still = np.zeros(code.axes)
    begin = at(code.accelerations, p, places[:, 0], rows.speeds, rows.inputs, still)
    end = at(code.accelerations, p, places[:, -1], rows.ahead, rows.inputs, still)
    return np.where(rows.moved, 0.5 * rows.dt[:, None] * (end - begin), 0.0)


def _places(code: Balance, p: Array, each: Sequence[Rows], bends: Sequence[Array]) -> list[Array]:
    """Positions at the nodes [N, NODES, nk] of each set, all logs side by side and so many samples at a time."""
    nk = each[0].start.shape[1]
    places = [np.zeros((len(rows.dt), NODES, nk)) for rows in each]
    if not nk:
        return places
    logs = [(k, *ends) for k, rows in enumerate(each) for ends in _ends(rows)]
    carried, longest = np.zeros((len(logs), nk)), max(last - first for _, first, last in logs)
    width = 2 + each[0].inputs.shape[1] + 3 * each[0].speeds.shape[1] + nk * (1 + NODES)
    step = max(_FEWEST, _NUMBERS // (width * (len(logs) + -len(logs) % lanes())))
    for t in range(0, longest, step):
        going = [i for i, (_, first, last) in enumerate(logs) if first + t < last]
        parts = [(k, slice(first + t, min(first + t + step, last))) for k, first, last in (logs[i] for i in going)]
        padded = np.zeros((len(going), min(step, longest - t), width - nk * NODES))
        for own, (k, part) in zip(padded, parts, strict=True):
            own[: part.stop - part.start] = _table(each[k], bends[k], part)
        found = code.walk(p, padded, carried[going]).reshape(*padded.shape[:2], NODES, nk)
        for own, (k, part) in zip(found, parts, strict=True):
            places[k][part] = own[: part.stop - part.start]
        carried[going] = found[:, -1, -1]
    return places


def _ends(rows: Rows) -> Iterator[tuple[int, int]]:
    """First row of every log, and that of the next."""
    begins = np.flatnonzero(rows.first).tolist()
    return zip(begins, [*begins[1:], len(rows.dt)], strict=True)


def _table(rows: Rows, bends: Array, part: slice) -> Array:
    """What a walk reads."""
    columns = (rows.dt[part, None], rows.inputs[part], rows.speeds[part], rows.ahead[part], bends[part])
    return np.concatenate([*columns, rows.first[part, None].astype(float), rows.start[part]], axis=1)
