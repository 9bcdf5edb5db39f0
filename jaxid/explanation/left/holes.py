"""Explain logs in parts where rows are missing for so long that nobody knows what the robot was given there.

A row or two that were dropped can be put back (`lost_inputs.py`); of seconds there is no telling, and a simulation through
them, with the last input held, is wrong from there on. Each part is a log of its own that starts in motion.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

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


def _holes(log: Log, changes: np.ndarray) -> np.ndarray:
    """The last samples before many rows are missing, of those after which an input is another one."""
    return changes[np.diff(log.time)[changes] > _MANY * log.sampling_interval]


def _parts(log: Log, holes: np.ndarray) -> list[Log]:
    """The parts of a log between its holes; the log itself where too much of it would be left out, being too short."""
    edges = [None, *(float(log.time[hole + 1]) for hole in holes), None]
    rows = [slice(a, b) for a, b in pairwise([0, *(int(hole) + 1 for hole in holes), len(log)])]
    long = [k for k, own in enumerate(rows) if log.time[own.stop - 1] - log.time[own.start] > _SHORTEST * log.duration]
    if sum(rows[k].stop - rows[k].start for k in long) < _MOST * len(log):
        return [log]
    return [log.window(edges[k], edges[k + 1]) for k in long]


def _cut(logs: LogSet) -> tuple[LogSet, list[str]]:
    """The logs in parts, and the names of those that were cut."""
    found: list[Log] = []
    names = []
    for log, changes in zip(logs, unknown_changes(logs), strict=True):
        holes = _holes(log, changes)
        parts = _parts(log, holes) if len(holes) else [log]
        found += parts
        names += [] if parts == [log] else [log.name]
    return LogSet(found), names


def cut_at_holes(
    fit: Fit, logs: LogSet, held_out: LogSet, report: Callable[[str], None], **options: Any
) -> tuple[Fit, LogSet, LogSet, str]:
    """The fit and the logs in parts, and a sentence on that, where an input changed while many rows are missing and the fit
    leaves something; else as they were. `options` are those of the fit (`output_error`)."""
    (own, fitted), (other, judging) = _cut(logs), _cut(held_out)
    before = held_out_state(fit.robot, held_out) if (fitted or judging) and fit.window is None else None
    if before is None or before.adequate:
        return fit, logs, held_out, ""
    report("many rows are missing where inputs changed; going on in parts")
    try:
        again = output_error(fit.robot, own, **options) if fitted else fit
    except ParameterError:
        return fit, logs, held_out, ""
    if again.failed or not held_out_state(again.robot, other).normalised_rms < _LESS * before.normalised_rms:
        return fit, logs, held_out, ""
    said = (
        f"Cut into parts that start in motion, since many rows are missing in which an input changed: "
        f"{', '.join((*fitted, *judging))}. What the robot was given in between, no log tells."
    )
    return again, own, other, said
