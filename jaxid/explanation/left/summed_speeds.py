"""Explain the positions that speeds add up to, where these are differences of counts and a controller answers them.

The rounding of a count is in two rows of its differences, with opposite signs, and a controller writes the first of them into
the command that acts when the second comes. A filter of the commands then foretells part of the sensor's noise, which no
robot does, and the parameters follow it. Of the counts themselves the rounding is white.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ...estimate.output_error.counted_speeds import biased_by_counts
from ...estimate.output_error.feedback import fed_back
from ...estimate.output_error.output_error import output_error
from ...estimate.result import Fit
from ...logs import LogSet
from ...parameters import ParameterError
from ...simulation.summed_speeds import Summed, as_positions, in_a_mapping
from .heldout import held_out_state

_WITHIN = 1.0
"""Counts (RMS) within which a model that follows its wheels to the end of each log leaves nothing but their rounding, and what
small effects leave beside it."""


def on_summed_speeds(
    fit: Fit, logs: LogSet, held_out: LogSet, report: Callable[[str], None], **options: Any
) -> tuple[Fit, LogSet, LogSet, str]:
    """The fit and the logs with positions in the place of the speeds, and a sentence on that, where the speeds are
    differences of counts that a controller answers, the fit leaves something, and the model follows the counts to within one of
    them; else as they were. `options` are those of the fit (`output_error`)."""
    trusted = fit.judgement is not None and fit.judgement.trustworthy
    if fit.window is not None or (trusted and held_out_state(fit.robot, held_out).adequate):
        return fit, logs, held_out, ""
    summed, others = as_positions(fit.robot, logs), as_positions(fit.robot, held_out)
    if summed is None or others is None or not fed_back(fit, logs).closed:
        return fit, logs, held_out, ""
    report("the speeds are differences of counts that a controller answers; fitting the positions that they add up to")
    try:
        again = output_error(summed.robot, summed.logs, **options)
    except ParameterError:
        return fit, logs, held_out, ""
    if again.window is not None or not max(_counts_off(again, some) for some in (summed, others)) < _WITHIN:
        return fit, logs, held_out, ""
    said = (
        f"{biased_by_counts(logs, closed=True)}. The positions that they add up to are explained here; to fit them, take the "
        f"mapping {in_a_mapping(fit.robot)}."
    )
    return replace(again, notes=(*again.notes, said)), summed.logs, others.logs, said


def _counts_off(fit: Fit, summed: Summed) -> float:
    """By how many counts (RMS) the fitted model is off, of the position for which these are most."""
    state = held_out_state(fit.robot, summed.logs)
    return max(
        state.noise[name] * own / summed.steps[name] for name, own in state.by_channel.items() if name in summed.steps
    )
