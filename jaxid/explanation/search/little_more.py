"""A sensor's effect beside a curve that is near enough: little by its size, and yet all that is left.

What a curve through few points leaves of its own, a further effect of forces may well take up (`worth.py`), so that so little
names none. A constant or drifting error of a sensor is no shape of friction: where it takes up all, it was missing. But a
sensor's scale may stand for what a curve lacks: where the curve through more points, or one that reaches farther, leaves as
little, it is that.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ...effects.curve import Curve
from ...logs import LogSet
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..policy import current_policy
from ..refits.candidate_refits import Report, all_added
from ..refits.refit import Trial, continued, refit_from_itself
from ..screening.first_look import first_look
from .denser import may_reach_farther, with_denser_curve, with_farther_reach
from .from_the_back import not_present
from .steps import Step
from .telling_apart import not_told_apart, simplest_first, supersets, told_apart_from
from .worth import likelier, undone

_TRIED = 2
"""Mechanisms that are refitted."""


def with_a_sensor_besides(
    steps: list[Step],
    current: Trial,
    effects: Sequence[Effect],
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> tuple[list[Step], Trial]:
    """The steps, and the model, with an effect of a sensor that leaves nothing, where those before leave too little for a
    further name; else as they were."""
    if not steps or current.held_out.adequate or current.angles or not _little(current):
        return steps, current
    remaining = [effect for effect in not_present(current.robot, effects) if effect.where == "sensor"]
    if not remaining:
        return steps, current
    say("looking whether an effect of a sensor takes up the little that is left")
    screened = first_look(current, logs, remaining, noise, say)
    policy = current_policy()
    likely = [c for c in screened if c.share > policy.unexplained][:_TRIED]
    trials = [continued(t, logs, held_out, noise) for t in all_added(current, likely, logs, held_out, noise, say)]
    tried = max(sum(1 + len(c.laws) for c in screened), 1)
    trials = [
        trial
        for trial in trials
        if _all_that_is_left(trial, current)
        and likelier(current, trial, tried)
        and not undone(trial, current, held_out, noise)
    ]
    for robot in _freer_curves(current.robot) if trials else ():
        say("refitting with a curve through more points instead")
        freer = replace(refit_from_itself(robot, current, logs, held_out, noise), id=current.id)
        trials = [trial for trial in trials if told_apart_from(trial, freer)]
        if not trials:
            return steps, freer if told_apart_from(freer, current) else current
    if not trials:
        return steps, current
    trials = simplest_first(sorted(trials, key=lambda trial: trial.score))
    equivalent = tuple(name for name in not_told_apart(trials, current) if name not in supersets(trials))
    say(f"added {trials[0].id}: held-out {trials[0].held_out.normalised_rms:.3f} x noise")
    found = Step(tuple(trials), equivalent, tuple(screened), current, trials[0], (trials[0],), (trials[0].law,))
    return [*steps, found], trials[0]


def _freer_curves(robot: Robot) -> Iterator[Robot]:
    """The robot with each of its curves through more points, and reaching farther where it may."""
    for effect in robot.effects:
        if isinstance(effect, Curve):
            yield with_denser_curve(robot, effect.id)
            if may_reach_farther(robot, effect):
                yield with_farther_reach(robot, effect.id)


def _little(trial: Trial) -> bool:
    """Whether what is left is little by its size."""
    return trial.held_out.normalised_rms < current_policy().coarse_curve and not trial.held_out.diverged


def _all_that_is_left(trial: Trial, before: Trial) -> bool:
    """Whether an effect leaves next to nothing of what there was."""
    small = trial.held_out.gap < current_policy().unexplained * before.held_out.gap
    return trial.held_out.adequate or (small and trial.held_out.normalised_rms < current_policy().small)
