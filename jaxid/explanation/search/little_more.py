"""What takes up all that is left, beside effects that are near enough for a further name to close too little of the gap.

What a law leaves of its own, a further effect may well take up (`worth.py`), so that so little names none. It does where it
leaves nothing, and the laws there are, given more freedom, leave more: a curve through more points, or that reaches farther, or
of every part of the robot; a formula's mechanism by its curve. An error of a sensor may be so small that only this shows it.
Beside coloured noise, which is most of what is left, nothing more is left where only that is.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ...effects import laws_of
from ...effects.curve import Curve
from ...logs import LogSet
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..policy import current_policy
from ..refits.candidate_refits import Report, all_added
from ..refits.refit import Trial, continued, refit_from_itself
from ..screening.first_look import first_look
from .colour_left import explaining, leaves_only_colour
from .denser import (
    may_be_denser,
    may_reach_farther,
    with_curves_apart,
    with_denser_curve,
    with_farther_reach,
    with_freer_form,
    with_further_terms,
)
from .from_the_back import not_present
from .reconsider import by_its_curve
from .steps import Step
from .telling_apart import clearly_better, not_told_apart, simplest_first, supersets, told_apart_from
from .worth import likelier, undone

_TRIED = 2
"""Mechanisms that are refitted."""


def with_the_little_more(
    steps: list[Step],
    current: Trial,
    base: Trial,
    effects: Sequence[Effect],
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> tuple[list[Step], Trial]:
    """The steps, and the model, with an effect that takes up what those before leave, where that is too little for a further
    name; else as they were. `base` is the model without any of them."""
    policy, left = current_policy(), current.held_out
    if not steps or left.adequate or current.angles or left.diverged or left.normalised_rms > policy.many:
        return steps, current
    little = left.normalised_rms <= policy.coarse_law
    remaining = [e for e in not_present(current.robot, effects, logs) if e.where == "sensor" or not little]
    say("looking whether one effect takes up all the little that is left")
    screened = first_look(current, logs, remaining, noise, say) if remaining else []
    likely = [c for c in screened if c.share > _least_share(c.effect)][:_TRIED]
    coloured = [c for c in explaining(screened) if c not in likely][:_TRIED] if not little else []
    added = all_added(current, [*likely, *coloured], logs, held_out, noise, say)
    trials = [continued(trial, logs, held_out, noise) for trial in added]
    tried = max(sum(1 + len(c.laws) for c in screened), 1)
    trials = [
        trial
        for trial in trials
        if (_takes_it_up(trial, current) or leaves_only_colour(current, trial, tried, logs, held_out, noise))
        and likelier(current, trial, tried)
        and not undone(trial, current, held_out, noise)
    ]
    for freer in _freer(current, base, logs, held_out, noise, say) if trials else ():
        trials = [trial for trial in trials if told_apart_from(trial, freer)]
        if not trials:
            better = _has_a_name(freer.robot) and told_apart_from(freer, current)
            return steps, freer if better else current
    if not trials:
        return steps, current
    trials = simplest_first(sorted(trials, key=lambda trial: trial.score))
    equivalent = tuple(name for name in not_told_apart(trials, current) if name not in supersets(trials))
    say(f"added {trials[0].id}: held-out {trials[0].held_out.normalised_rms:.3f} x noise")
    found = Step(tuple(trials), equivalent, tuple(screened), current, trials[0], (trials[0],), (trials[0].law,))
    return [*steps, found], trials[0]


def _least_share(effect: Effect) -> float:
    """The share of what is left that an effect must promise: of one that is no sensor's all but little."""
    unexplained = current_policy().unexplained
    return unexplained if effect.where == "sensor" else 1.0 - 2.0 * unexplained


def _takes_it_up(trial: Trial, before: Trial) -> bool:
    """Whether an effect leaves next to nothing of what there was. An error of a sensor is no shape of a force: it does so on
    the held-out logs where so little is left that nothing else is there. Others do on the fitted logs, and clearly help on
    those held out, where the laws before are less near."""
    policy = current_policy()
    effect, left, was = trial.effect, trial.held_out, before.held_out
    if effect is not None and effect.where == "sensor" and was.normalised_rms < policy.coarse_curve:
        small = left.gap < policy.unexplained * was.gap and left.normalised_rms < policy.small
        return left.adequate or small
    enough = was.normalised_rms > policy.coarse_law
    return enough and trial.fitted.gap < policy.unexplained * before.fitted.gap and clearly_better(left, was)


def _freer(
    current: Trial, base: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float], say: Report
) -> Iterator[Trial]:
    """The model with more freedom in each of the laws that were added, refitted."""
    given = {effect.id for effect in base.robot.effects}
    for effect in current.robot.effects:
        if effect.id in given:
            continue
        say(f"refitting with more freedom in {effect.title} instead")
        for robot in _freer_laws(current.robot, effect):
            yield replace(refit_from_itself(robot, current, logs, held_out, noise), id=current.id)
        if not isinstance(effect, Curve):
            by_curve = by_its_curve(effect.id, current, base, logs, held_out, noise, say)
            if by_curve is not None:
                yield replace(by_curve, id=current.id)


def _has_a_name(robot: Robot) -> bool:
    """Whether all its laws are the catalogue's, and none a freer form that is only compared."""
    return all(e.law in {law.law for law in laws_of(replace(robot, effects=()), e.id)} for e in robot.effects)


def _freer_laws(robot: Robot, effect: Effect) -> Iterator[Robot]:
    """The robot with a curve of its through more points, one of every part, and reaching farther where it may; with a freer
    form, or further terms, of a formula that has such."""
    if not isinstance(effect, Curve):
        if effect.freer is not None:
            yield with_freer_form(robot, effect)
        if effect.denser is not None:
            yield with_further_terms(robot, effect.id)
        return
    if not may_be_denser(robot, effect):
        return
    yield with_denser_curve(robot, effect.id)
    if not effect.apart and len(effect.parts(robot)) > 1:
        yield with_curves_apart(robot, effect.id)
    if may_reach_farther(robot, effect):
        yield with_farther_reach(robot, effect.id)
