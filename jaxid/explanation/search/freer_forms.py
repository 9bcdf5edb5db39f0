"""Mechanisms whose formulas lack little of what the best one explains, asked again by their form with another exponent.

Nature's drag has no exponent of two, nor its friction that of the catalogue. Where a formula of another mechanism is behind the
best by a little, it is the exponent that is wrong, and not the mechanism: by its freer form the data may not tell it apart.
"""

from collections.abc import Callable, Sequence

from ...effects.curve import SHAPE
from ...robots.robot import Robot
from ..refits.refit import Trial
from .denser import with_freer_form
from .laws import NEARLY
from .telling_apart import alike


def as_well_by_a_freer_form(
    trials: Sequence[Trial], base: Trial, again: Callable[[Robot, Trial], Trial]
) -> dict[str, Trial]:
    """The trials, by mechanism, of freer forms that the data cannot tell from the first trial, of mechanisms that it tells
    apart by their formula. Asked where the first leaves only noise by a formula: a curve follows another's formula anyhow.

    `again` refits a robot from its own values, and from the initial states of a trial.
    """
    best = trials[0]
    # Of a plant in its loop the effects are the plant's, which are not exchanged one by one.
    if best.law == SHAPE or not best.fitted.adequate or base.robot.controlled:
        return {}
    least = best.score + NEARLY * (base.score - best.score)
    same = {trial.id for trial in alike(trials, base)}
    found = {}
    for trial in trials[1:]:
        effect = trial.effect
        if effect is None or effect.freer is None or trial.id in same or not trial.score < least:
            continue
        freely = again(with_freer_form(trial.robot, effect), trial)
        if alike([best, freely]):
            found[trial.id] = freely
    return found
