"""Laws of fewer parameters in the place of those that were chosen while other effects were missing.

A curve, or another law of many parameters, follows a part of what is still missing as well, and may have been best by that.
Once everything is there, a plainer law of its mechanism may leave no more, beside parameters that the many leave open; and
where nothing helps beside such a law, something may beside a plainer one.
"""

from collections.abc import Sequence
from dataclasses import replace

from ...effects.curve import SHAPE
from ...logs import LogSet
from ..refits.candidate_refits import Report
from ..refits.refit import Trial
from .laws import best_first
from .reconsider import with_rivals
from .steps import Step, laws_in
from .telling_apart import alike

_MOST = 4
"""Most laws of a mechanism that are tried."""


def by_plainer_laws(
    steps: Sequence[Step],
    current: Trial,
    base: Trial,
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> tuple[list[Step], Trial]:
    """The steps by a law of fewer parameters of their mechanism, where the data cannot tell it from the one they have in the
    model with all that was added. What was chosen beside just these laws of the others stays."""
    revised = list(steps)
    for place, step in enumerate(steps):
        effect = next((own for own in current.robot.effects if own.id == step.chosen.id), None)
        if effect is None or current.angles:
            continue
        if laws_in(step.before.robot, effect.id) == laws_in(current.robot, effect.id):
            continue
        others = [law for law in step.laws if law.id == effect.id and law.law not in (SHAPE, effect.law)]
        plainer = [law for law in others if law.free < step.chosen.free][:_MOST]
        trials = with_rivals(plainer, effect.id, current, base, logs, held_out, noise, say)
        own = best_first([replace(current, id=effect.id), *trials])
        if own[0].law == effect.law:
            continue
        say(f"{own[0].title} instead of {effect.title}: held-out {own[0].held_out.normalised_rms:.3f} x noise")
        same = tuple(trial.law for trial in alike(own) if trial.law not in (SHAPE, effect.law))
        then = next(trial for trial in step.laws if trial.law == own[0].law)
        trials = (own[0], *step.trials[1:])
        revised[place] = replace(step, trials=trials, laws=tuple(own), laws_alike=same, as_it_was=then)
        current = replace(own[0], id=current.id)
    return revised, current


def with_a_plainer_law(steps: Sequence[Step]) -> tuple[list[Step], Trial] | None:
    """The last of the steps by the best of its mechanism's laws of fewer parameters, to go on from where nothing helps beside
    the law that it has: with many parameters that one may have taken up, on the fitted logs alone, what the next is for."""
    if not steps:
        return None
    step = steps[-1]
    plainer = [
        law for law in step.laws if law.id == step.chosen.id and law.free < step.chosen.free and law.law != SHAPE
    ]
    if not plainer or step.after.angles:
        return None
    trial = min(plainer, key=lambda law: law.score)
    others = tuple(law for law in step.laws if law is not trial)
    again = replace(step, trials=(trial, *step.trials[1:]), after=trial, laws=(trial, *others), laws_alike=())
    return [*steps[:-1], again], trial
