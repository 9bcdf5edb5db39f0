"""Readings that tell nothing of the motion: at the end of a sensor's range, of a sensor that is dead in one of the logs, of one
that was frozen for a while, and those that a slower sensor repeats.

A reading at the end of the range says only that there was at least that much, one that never changes nothing at all, and one
that is repeated what was some samples before. Taken as measurements, a fit follows them rather than the robot.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .log import Log, LogSet
from .noise import updates_of, white_level

_SHARE, _VISITS, _STAYS = 0.05, 3, 2
"""Share of a signal's samples at its extreme, and visits there of so many samples and more, from which it is clipped."""
_FEWEST, _LEVELS = 20, 0.2
"""Samples elsewhere, and share of these that are levels of their own: of few levels it returns to its largest unclipped."""

_FROZEN, _HOLDS = 50, 20.0
"""Samples that a frozen sensor shows the same, and how often as many as it usually does."""
_BEYOND, _AWAY = 1.5, 0.1
"""Times its noise by which a sensor varies that shows a motion, and share of its largest reading which it shows on average."""
_SETTLED, _DROPPED = 1e-4, 0.1
"""Steps, as shares of the largest reading: one that is no jump but the end of a smooth approach, and one that is a drop-out
where the reading is zero, which is the true one of a robot that stands."""


def at_the_end(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which samples [T] of a signal lie at the end of its range, to which it keeps returning exactly; none if it does not."""
    size = np.abs(np.nan_to_num(values))
    extreme = float(np.max(size, initial=0.0))
    at = size == extreme
    rest = values[~at & np.isfinite(values)]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]])))
    visits = np.count_nonzero(edges[1::2] - edges[::2] >= _STAYS)
    there = extreme > 0 and len(rest) >= _FEWEST and len(np.unique(rest)) >= _LEVELS * len(rest)
    return at if there and at.mean() > _SHARE and visits >= _VISITS else np.zeros(len(values), dtype=bool)


def _still(values: NDArray[np.float64]) -> bool:
    there = values[np.isfinite(values)]
    return bool(len(there)) and np.ptp(there) == 0


def _dead(logs: Sequence[Log], log: Log, name: str) -> bool:
    """Whether a sensor that moves in others of the `logs` never changes in this one, while another sensor does."""
    if not _still(log.output(name)) or all(_still(own.output(name)) for own in logs if name in own.measured):
        return False
    return any(not _still(log.output(other)) for other in log.measured if other != name)


def _ends(logs: Sequence[Log], log: Log, name: str) -> NDArray[np.bool_]:
    """Which samples of a log are at the end of a sensor's range: of that which it shows there, or in all logs together."""
    own = log.output(name)
    every = np.concatenate([other.output(name) for other in logs])
    ends = at_the_end(every)
    limit = np.max(np.abs(every[ends])) if ends.any() else np.inf
    return (np.abs(own) >= limit) | at_the_end(own)


def _changes(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where a signal differs from its sample before [T - 1]."""
    return values[1:] != values[:-1]


def _moves(stretch: NDArray[np.float64], whole: NDArray[np.float64]) -> bool:
    """Whether a sensor goes on over a `stretch` of a signal, and not by its noise alone, which goes on at rest, too."""
    there = stretch[np.isfinite(stretch)]
    if len(there) < 2 or not _changes(stretch).mean() > 0.5:
        return False
    largest = float(np.max(np.abs(np.nan_to_num(whole)), initial=0.0))
    return bool(np.std(there) > _BEYOND * white_level(there) or abs(np.mean(there)) > _AWAY * largest)


def _frozen(log: Log, name: str) -> NDArray[np.bool_]:
    """Which samples of a speed repeat one that a sensor was frozen at, while others went on; none of a slower sensor's."""
    values, found = log.output(name), np.zeros(len(log), dtype=bool)
    largest = float(np.max(np.abs(np.nan_to_num(values)), initial=0.0))
    if name in log.channels.positions or not largest:
        return found
    others = [log.output(other) for other in log.measured if other != name]
    edges = np.concatenate([[0], np.flatnonzero(_changes(values)) + 1, [len(values)]])
    lengths = np.diff(edges)
    enough = max(_FROZEN, _HOLDS * float(np.quantile(lengths, 0.95)))
    for start, length in zip(edges[:-1][lengths >= enough], lengths[lengths >= enough], strict=True):
        jump = abs(values[start] - values[start - 1]) / largest if start else 0.0
        moves = any(_moves(own[start : start + length], own) for own in others)
        if moves and jump >= (_SETTLED if values[start] else _DROPPED):
            found[start + 1 : start + length] = True
    return found


def _repeated(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which samples [T] repeat the reading of a sensor that is slower than the log; none of one that is not."""
    updates, found = updates_of(values), np.zeros(len(values), dtype=bool)
    if updates is None:
        return found
    found[np.flatnonzero(np.isfinite(values))[1:]] = True
    found[updates] = False
    return found


def without_unusable(*sets: LogSet) -> tuple[tuple[LogSet, ...], list[str]]:
    """The sets with such readings taken for missing, and what was taken out, in words."""
    every, said = [log for logs in sets for log in logs], []

    def cleared(log: Log) -> Log:
        outputs = np.array(log.outputs)
        for name in log.measured:
            column, values = log.channels.measured.index(name), log.output(name)
            if _dead(every, log, name):
                # A log has some reading of every output; where it begins, at rest, that of a dead sensor may even be right.
                outputs[np.flatnonzero(np.isfinite(values))[1:], column] = np.nan
                said.append(f"{name} of {log.name}, which never changes there")
            elif name not in log.channels.positions and (ends := _ends(every, log, name)).any():
                outputs[ends, column] = np.nan
                unit = log.channels.units.get(name, "")
                said.append(
                    f"{ends.mean():.0%} of {name} of {log.name}, at the end of its range ({np.nanmax(np.abs(values)):.4g} "
                    f"{unit}".rstrip()
                    + ")"
                )
            elif (frozen := _frozen(log, name)).any():
                outputs[frozen, column] = np.nan
                first = int(np.argmax(frozen))
                since = f"frozen at {values[first]:.4g} from {log.time[first]:.3g} s on"
                said.append(f"{frozen.mean():.0%} of {name} of {log.name}, {since}")
            elif (repeated := _repeated(values)).any():
                outputs[repeated, column] = np.nan
                said.append(f"what {name}, whose sensor is slower than the logs, repeats of the reading before")
        return replace(log, outputs=outputs) if not np.array_equal(outputs, log.outputs, equal_nan=True) else log

    cleared_sets = tuple(LogSet([cleared(log) for log in logs]) for logs in sets)
    return cleared_sets, list(dict.fromkeys(said))
