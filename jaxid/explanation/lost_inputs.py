"""Rows that are missing where an input changed: the logs with those rows put back, where that predicts what was measured."""

from collections.abc import Callable
from typing import Any

import numpy as np

from .._float64 import in_float64
from ..estimate.output_error.lost_inputs import with_lost_inputs
from ..estimate.output_error.lost_rows import unknown_changes
from ..estimate.output_error.output_error import output_error
from ..estimate.result import Fit
from ..logs import LogSet, noise_scale
from ..parameters import ParameterError
from .heldout import held_out_state
from .refit import refit

_ROUNDS = 2
"""Times that inputs and parameters are estimated in turn."""


@in_float64
def with_inputs_put_back(
    fit: Fit, logs: LogSet, held_out: LogSet, report: Callable[[str], None], **options: Any
) -> tuple[Fit, LogSet, LogSet, str]:
    """The fit and the logs with rows put back in which an input changed unseen, and a sentence on that, where the fit leaves
    something and the fitted logs are then predicted better by more than chance; else as they were. `options` are those of the
    fit (`output_error`)."""
    if (
        fit.window is not None
        or not any(map(len, unknown_changes(logs)))
        or held_out_state(fit.robot, held_out).adequate
    ):
        return fit, logs, held_out, ""
    report("inputs changed where rows are missing; estimating when")
    noise = noise_scale(held_out, otherwise=logs)
    start = {name: fit.robot.parameters[name].value for name in fit.free_names}
    given = refit(fit.robot, [start], logs, held_out, noise, fit.initial_states)
    robot, again, found = given.robot, given, with_lost_inputs(given.robot, logs, noise)
    if not found.places:  # too many rows in one place to say anything
        return fit, logs, held_out, ""
    for _ in range(_ROUNDS):
        start = {name: robot.parameters[name].value for name in fit.free_names}
        again = refit(robot, [start], found.logs, held_out, noise, fit.initial_states)
        robot = again.robot
        found = with_lost_inputs(robot, logs, noise)
    samples = sum(int(np.isfinite(log.outputs).sum()) for log in logs)
    if not given.squares - again.squares > found.places * np.log(samples):
        return fit, logs, held_out, ""
    start = {name: robot.parameters[name].value for name in fit.free_names}
    try:
        refitted = found.widened(output_error(fit.robot, found.logs, start=start, **options))
    except ParameterError:
        return fit, logs, held_out, ""
    judged_on = with_lost_inputs(refitted.robot, held_out, noise)
    said = (
        f"Rows are missing in {found.places + judged_on.places} places where an input is another one after them. When it "
        "changed was estimated from what the robot did, which is likelier by far than that it was held; standard errors allow "
        "for it."
    )
    return refitted, found.logs, judged_on.logs, said
