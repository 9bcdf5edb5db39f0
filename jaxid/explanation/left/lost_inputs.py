"""Rows that are missing where an input changed: the logs with those rows put back, where that predicts what was measured."""

from collections.abc import Callable
from typing import Any, NamedTuple

from ..._float64 import in_float64
from ...estimate.output_error.lost_inputs import with_inputs_between, with_lost_inputs
from ...estimate.output_error.lost_rows import unknown_changes
from ...estimate.output_error.output_error import output_error
from ...estimate.result import Fit
from ...logs import LogSet, noise_scale
from ...parameters import ParameterError
from ...robots.robot import Robot
from ..policy import current_policy
from ..refits.refit import Trial, refit
from .heldout import held_out_state

_ROUNDS = 2
"""Times that inputs and parameters are estimated in turn."""


class PutBack(NamedTuple):
    """A fit and its logs with rows put back in which an input changed unseen, `said` in a sentence (empty where none were), and
    whether the moments at which it did were `estimated` one by one."""

    fit: Fit
    logs: LogSet
    held_out: LogSet
    said: str = ""
    estimated: bool = False


@in_float64
def with_inputs_put_back(
    fit: Fit, logs: LogSet, held_out: LogSet, report: Callable[[str], None], **options: Any
) -> PutBack:
    """The fit and the logs with rows put back in which an input changed unseen, where the fit leaves something and the fitted
    logs are then predicted better by more than chance, halfway between its two values or from a moment that is estimated;
    else as they were. `options` are those of the fit (`output_error`)."""
    given = PutBack(fit, logs, held_out)
    if (
        fit.window is not None
        or not any(map(len, unknown_changes(logs)))
        or held_out_state(fit.robot, held_out).adequate
    ):
        return given
    report("inputs changed where rows are missing; estimating when")
    noise = noise_scale(held_out, otherwise=logs)

    def refitted(robot: Robot, some: LogSet) -> Trial:
        start = {name: robot.parameters[name].value for name in fit.free_names}
        return refit(robot, [start], some, held_out, noise, fit.initial_states)

    def in_full(trial: Trial, some: LogSet) -> Fit | None:
        start = {name: trial.robot.parameters[name].value for name in fit.free_names}
        try:
            return output_error(fit.robot, some, start=start, **options)
        except ParameterError:
            return None

    held, between = refitted(fit.robot, logs), with_inputs_between(logs)
    halfway = refitted(held.robot, between)
    least = (2.0 * current_policy().separated) ** 2
    nearer = held.squares - halfway.squares > least
    robot, again, found = held.robot, held, with_lost_inputs(held.robot, logs, noise)
    if not found.places:  # too many rows in one place to say anything
        return given
    for _ in range(_ROUNDS):
        again = refitted(robot, found.logs)
        robot = again.robot
        found = with_lost_inputs(robot, logs, noise)
    estimated = again.squares + found.price
    if held.squares - estimated > least and halfway.squares > estimated:
        own = in_full(again, found.logs)
        if own is None:
            return given
        own = found.widened(own)
        judged_on = with_lost_inputs(own.robot, held_out, noise)
        how = (
            "When it changed was estimated from what the robot did, which is likelier by far than that it was held; standard "
            "errors allow for it."
        )
        return PutBack(own, found.logs, judged_on.logs, _said(found.places + judged_on.places, how), True)
    own = in_full(halfway, between) if nearer else None
    if own is None:
        return given
    places = sum(map(len, unknown_changes(logs))) + sum(map(len, unknown_changes(held_out)))
    how = "In between it is taken to be halfway, which is likelier by far than that it was held."
    return PutBack(own, between, with_inputs_between(held_out), _said(places, how))


def _said(places: int, how: str) -> str:
    return f"Rows are missing in {places} places where an input is another one after them. {how}"
