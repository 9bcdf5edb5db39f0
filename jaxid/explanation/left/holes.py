"""Explain logs in parts where rows are missing for so long that nobody knows what the robot was given there.

A row or two that were dropped can be put back (`lost_inputs.py`); of seconds there is no telling, and a simulation through
them, with the last input held, is wrong from there on. Each part is a log of its own that starts in motion.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...estimate.output_error.lost_rows import unknown_changes
from ...estimate.output_error.output_error import output_error
from ...estimate.result import Fit
from ...logs import Log, LogSet
from ...parameters import ParameterError
from .heldout import held_out_state

_MANY = 10
"""Usual intervals that are more than a few rows."""
_SHORTEST = 0.1
"""Share of a log that a part must be long to be a log of its own; what is shorter is left out."""
_MOST = 0.8
"""Share of a log's samples that its parts must have."""
_LESS = 0.9
"""Share of the error on the held-out logs that the model must come below in parts: rows may be missing because nothing was
written while the input was held."""


class _Cut(NamedTuple):
    """Logs in parts, the names of those that were cut, and the seconds of parts that are too short."""

    logs: LogSet
    names: list[str]
    left_out: float


def _parts(log: Log, changes: NDArray[np.int64]) -> list[Log]:
    """The parts of a log that are long enough, between those of the unknown `changes` (last samples before one) that many
    missing rows make; the log itself where there are none, or where too much of it would be left out."""
    holes = changes[np.diff(log.time)[changes] > _MANY * log.sampling_interval]
    pairs = zip([0, *(holes + 1)], [*holes, len(log) - 1], strict=True)
    long = [(a, b) for a, b in pairs if log.time[b] - log.time[a] > _SHORTEST * log.duration]
    if not len(holes) or sum(b + 1 - a for a, b in long) < _MOST * len(log):
        return [log]
    return [log.window(log.time[a], None if b + 1 == len(log) else log.time[b + 1]) for a, b in long]


def _cut(logs: LogSet) -> _Cut:
    """The logs in parts, where these have most of a log."""
    found: list[Log] = []
    cut = _Cut(logs, [], 0.0)
    for log, changes in zip(logs, unknown_changes(logs), strict=True):
        parts = _parts(log, changes)
        found += parts
        if parts[0] is not log:
            lost = (len(log) - sum(map(len, parts))) * log.sampling_interval
            cut = cut._replace(names=[*cut.names, log.name], left_out=cut.left_out + lost)
    return cut._replace(logs=LogSet(found))


def cut_at_holes(
    fit: Fit, logs: LogSet, held_out: LogSet, report: Callable[[str], None], **options: Any
) -> tuple[Fit, LogSet, LogSet, str]:
    """The fit and the logs in parts, and a sentence on that, where an input changed while many rows are missing and the fit
    leaves something; else as they were. `options` are those of the fit (`output_error`)."""
    own, other = _cut(logs), _cut(held_out)
    names = (*own.names, *other.names)
    before = held_out_state(fit.robot, held_out) if names and fit.window is None else None
    if before is None or before.adequate:
        return fit, logs, held_out, ""
    report("many rows are missing where inputs changed; going on in parts")
    try:
        again = output_error(fit.robot, own.logs, **options) if own.names else fit
    except ParameterError:
        return fit, logs, held_out, ""
    if again.failed or not held_out_state(again.robot, other.logs).normalised_rms < _LESS * before.normalised_rms:
        return fit, logs, held_out, ""
    said = (
        f"Cut into parts that start in motion, since many rows are missing in which an input changed: {', '.join(names)}. What "
        "the robot was given in between, no log tells."
    )
    lost = own.left_out + other.left_out
    said += f" Parts of {lost:.3g} s together are too short for logs of their own, and are left out." if lost else ""
    return again, own.logs, other.logs, said
