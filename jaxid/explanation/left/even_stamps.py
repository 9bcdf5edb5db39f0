"""Stamps that scatter about an even clock: whether the robot ran by the clock, and its logs with that.

Loops that drive a robot are even to microseconds, while what writes their stamps is late by another share of the interval in
every row. Taken as they are, such stamps let commands act too early or too late, and a complete model then leaves errors that
follow the motion. Which of the two clocks was the robot's, the fitted logs say: nothing is estimated for it, so that the better
prediction has it, if it is better by more than chance.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ...estimate.output_error.output_error import output_error
from ...estimate.result import Fit
from ...logs import LogSet, noise_scale
from ...logs.even_clock import evenly
from ...parameters import ParameterError
from ..refits.refit import refit
from ..search.telling_apart import told_apart_from
from .heldout import held_out_state


def on_even_stamps(
    fit: Fit, logs: LogSet, held_out: LogSet, report: Callable[[str], None], **options: Any
) -> tuple[Fit, LogSet, LogSet, str]:
    """The fit and the logs with even stamps, and a sentence on that, where the stamps scatter, the fit leaves something, and
    even stamps predict the fitted logs better; else as they were. `options` are those of the fit (`output_error`)."""
    (even, sizes), (even_held_out, more) = evenly(logs), evenly(held_out)
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
        f"Even ones predict the fitted logs better, and are used here; {_for_every_command(even)}."
    )
    return again, even, even_held_out, said


def _for_every_command(even: LogSet) -> str:
    """How other commands get the even stamps: by the rows' numbers, where none is missing."""
    skipping = any(np.ptp(np.diff(log.time)) > 0.5 * log.sampling_interval for log in even)
    if not skipping:
        return "`t = {interval = seconds}` in a mapping reads the logs so for every command"
    return "rows are missing as well, so write even stamps into the logs, with the missing ones left out, for other commands"
