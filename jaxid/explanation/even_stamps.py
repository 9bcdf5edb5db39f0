"""Stamps that scatter about an even clock: whether the robot ran by the clock, and its logs with that.

Loops that drive a robot are even to microseconds, while what writes their stamps is late by another share of the interval in
every row. Taken as they are, such stamps let commands act too early or too late, and a complete model then leaves errors that
follow the motion. Which of the two clocks was the robot's, the fitted logs say: nothing is estimated for it, so that the better
prediction has it, if it is better by more than chance.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..estimate.output_error.output_error import output_error
from ..estimate.result import Fit
from ..logs import Log, LogSet, noise_scale
from ..parameters import ParameterError
from .heldout import held_out_state
from .refit import refit
from .telling_apart import told_apart_from

_FEWEST = 50
"""Rows of a log below which its clock is not told."""
_LEAST, _MOST = 0.003, 0.5
"""Scatter of the stamps, in intervals, that is looked at: less does nothing, beyond half of one a row's place is not known."""
_WANDERS = 0.3
"""Correlation of neighbouring stamps' errors from which they are those of the clock itself."""


def scatter(log: Log) -> tuple[np.ndarray, float]:
    """Stamps of an even clock [T] for a log, and how far the log's own scatter about them, in intervals; zero where they do not
    scatter about an even clock. Rows that are missing have their places, if the steps tell where."""
    steps = np.diff(log.time)
    skipping = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(steps / np.median(steps)), 1.0))])
    found = []
    for places in (np.arange(len(log), dtype=float), skipping):
        interval, begin = np.polyfit(places, log.time, 1)
        even = begin + interval * places
        found.append((even, (log.time - even) / interval))
    even, apart = min(found, key=lambda one: float(np.max(np.abs(one[1]))))
    size = float(np.std(apart))
    known = len(log) >= _FEWEST and size > _LEAST and float(np.max(np.abs(apart))) < _MOST
    wanders = known and float(apart[1:] @ apart[:-1]) > _WANDERS * float(apart @ apart)
    return even, size if known and not wanders else 0.0


def _evenly(logs: LogSet) -> tuple[LogSet, list[float]]:
    found, sizes = [], []
    for log in logs:
        even, size = scatter(log)
        found.append(replace(log, time=even) if size else log)
        sizes += [size] if size else []
    return LogSet(found), sizes


def on_even_stamps(
    fit: Fit, logs: LogSet, held_out: LogSet, report: Callable[[str], None], **options: Any
) -> tuple[Fit, LogSet, LogSet, str]:
    """The fit and the logs with even stamps, and a sentence on that, where the stamps scatter, the fit leaves something, and
    even stamps predict the fitted logs better; else as they were. `options` are those of the fit (`output_error`)."""
    (even, sizes), (even_held_out, more) = _evenly(logs), _evenly(held_out)
    if not sizes or fit.window is not None or held_out_state(fit.robot, held_out).adequate:
        return fit, logs, held_out, ""
    report("the stamps scatter about an even clock; fitting with even stamps")
    noise = noise_scale(held_out, otherwise=logs)
    start = {name: fit.robot.parameters[name].value for name in fit.free_names}
    given = refit(fit.robot, [start], logs, held_out, noise, fit.initial_states)
    evened = refit(fit.robot, [start], even, even_held_out, noise, fit.initial_states)
    if not (evened.squares < given.squares and told_apart_from(evened, given)):
        return fit, logs, held_out, ""
    try:
        again = output_error(fit.robot, even, start=start, **options)
    except ParameterError:
        return fit, logs, held_out, ""
    sizes, count = sizes + more, len(logs) + len(held_out)
    said = (
        f"The stamps of {len(sizes)} of {count} logs scatter about an even clock, by {np.median(sizes):.1%} of the interval. "
        "Even ones predict the fitted logs better, and are used here; `t = {interval = seconds}` in a mapping reads the logs "
        "so for every command."
    )
    return again, even, even_held_out, said
