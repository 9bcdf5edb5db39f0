"""Formulas in the place of curves that were chosen while other effects were missing.

A curve follows a part of what is still missing as well, and may have been best by that. Once everything is there, a formula of
its mechanism may leave no more, with parameters that the curve's many heights leave open.
"""

from collections.abc import Sequence
from dataclasses import replace

from ..effects.curve import SHAPE
from ..logs import LogSet
from .candidate_refits import Report
from .laws import best_first
from .reconsider import with_rival
from .refit import Trial
from .steps import Step
from .telling_apart import alike

_MOST = 4
"""Most formulas of a mechanism that are tried."""


def by_plainer_laws(
    steps: Sequence[Step],
    current: Trial,
    base: Trial,
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> tuple[list[Step], Trial]:
    """The steps but the last by a formula of their mechanism instead of its curve, where the data cannot tell it from the curve
    in the model with all that was added later."""
    revised = list(steps)
    for place, step in enumerate(steps[:-1]):
        effect = next((own for own in current.robot.effects if own.id == step.chosen.id), None)
        if effect is None or effect.law != SHAPE or current.angles:
            continue
        formulas = [trial for trial in step.laws if trial.law != SHAPE and trial.free < step.chosen.free][:_MOST]
        for formula in formulas:
            say(f"refitting with {formula.title} instead of its curve")
        trials = [with_rival(formula, effect.id, current, base, logs, held_out, noise) for formula in formulas]
        own = best_first([replace(current, id=effect.id), *trials])
        if own[0].law == SHAPE:
            continue
        say(f"{own[0].title} instead of its curve: held-out {own[0].held_out.normalised_rms:.3f} x noise")
        same = tuple(trial.law for trial in alike(own) if trial.law != SHAPE)
        then = next(trial for trial in step.laws if trial.law == own[0].law)
        trials = (own[0], *step.trials[1:])
        revised[place] = replace(step, trials=trials, laws=tuple(own), laws_alike=same, as_it_was=then)
        current = replace(own[0], id=current.id)
    return revised, current
