"""Two formulas of the speed in the place of one curve, such as friction that rises towards standstill and a drag.

A curve through few points follows the two together and leaves a little of both, beside which neither is worth a further name.
It is a mechanism of its own where it leaves nothing; where it does, two formulas that leave less are likelier.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from ...effects import catalogue, laws_of
from ...effects.curve import Curve
from ...logs import LogSet
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..refits.candidate_refits import Report, all_added
from ..refits.refit import Trial, continued
from ..screening.screen import Candidate
from .formulas import most_promising, unfitted_without
from .laws import best_first
from .reconsider import without
from .same_curves import SPEEDS
from .steps import Step
from .telling_apart import not_told_apart, simplest_first, supersets, told_apart_from
from .worth import likelier

_FOLLOWED = 2
"""Beside how many mechanisms a second is asked."""

Refits = tuple[LogSet, LogSet, dict[str, float], Report]
"""Logs to fit, held-out ones, the noise, and where progress is told."""


def _formulas(robot: Robot) -> list[Effect]:
    """The formulas that may be added to `robot` of mechanisms whose curve is one of the speed."""
    found: list[Effect] = []
    for mechanism in catalogue(robot):
        laws = laws_of(robot, mechanism.id)
        if any(isinstance(law, Curve) and law.variable in SPEEDS for law in laws):
            found += [law.blurred for law in laws if not isinstance(law, Curve) and not law.repeats]
    return found


class Beside(NamedTuple):
    """Formulas added to a model: each mechanism by its best law, the best first, and all laws of that one."""

    ranked: list[Trial]
    laws: list[Trial]
    screened: list[Candidate]
    alike: tuple[str, ...]

    @property
    def best(self) -> Trial:
        return self.ranked[0]


def formulas_beside(bare: Trial, formulas: Sequence[Effect], refits: Refits) -> Beside | None:
    """The most promising of some formulas added to a model; None where none promises anything."""
    logs, held_out, noise, say = refits
    likely = [law for law in most_promising(bare, formulas, logs, noise) if law.gain > 0]
    trials = all_added(bare, likely, logs, held_out, noise, say)
    # All to the end, and none left out for how it holds alone: what lags by itself may be one of the two.
    trials = [continued(trial, logs, held_out, noise) for trial in trials if math.isfinite(trial.score)]
    trials.sort(key=lambda trial: trial.score)
    by_name: dict[str, list[Trial]] = {}
    for trial in trials:
        by_name.setdefault(trial.id, []).append(trial)
    if not by_name:
        return None
    ranked = simplest_first([best_first(own)[0] for own in by_name.values()])
    alike = tuple(name for name in not_told_apart(ranked, bare) if name not in supersets(ranked))
    return Beside(ranked, best_first(by_name[ranked[0].id]), likely, alike)


def _pair(bare: Trial, base: Trial, refits: Refits) -> tuple[Trial, Beside, Beside] | None:
    """The best single formula, and the two that are best together, each of them with what else was tried beside the other."""
    alone = formulas_beside(bare, _formulas(bare.robot), refits)
    if alone is None:
        return None
    every = [formulas_beside(first, _formulas(first.robot), refits) for first in alone.ranked[:_FOLLOWED]]
    seconds = [own for own in every if own is not None]
    if not seconds:
        return None
    second = min(seconds, key=lambda own: own.best.score)
    # The first, and its law, were chosen while the second was missing.
    name = next(effect.id for effect in reversed(second.best.robot.effects) if effect.id != second.best.id)
    without_it = unfitted_without(name, second.best, base)
    first = formulas_beside(without_it, _formulas(without_it.robot), refits)
    if first is None:
        return None
    if first.best.score < second.best.score:
        without_it = unfitted_without(second.best.id, first.best, base)
        again = formulas_beside(without_it, _formulas(without_it.robot), refits)
        if again is None or again.best.id != second.best.id:
            return None
        # The same model from two sides, of which a refit may have ended elsewhere.
        best = replace(min(first.best, again.best, key=lambda trial: trial.score), id=again.best.id)
        second = again._replace(ranked=[best, *again.ranked[1:]], laws=[best, *again.laws[1:]])
    return alone.best, first, second


def by_two_formulas(
    steps: Sequence[Step],
    current: Trial,
    base: Trial,
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> tuple[list[Step], Trial]:
    """The steps with a curve of the speed that leaves more than noise by two formulas, where these are likelier and leave less
    of logs that chose nothing; else as they were."""
    curves = [e for e in current.robot.effects if isinstance(e, Curve) and e.variable in SPEEDS]
    place = next((k for k, s in enumerate(steps) if any(e.id == s.chosen.id for e in curves)), None)
    if place is None or current.angles or current.held_out.adequate:
        return list(steps), current
    step = steps[place]
    say(f"looking whether two formulas are what {step.chosen.title} follows")
    found = _pair(unfitted_without(step.chosen.id, current, base), base, (logs, held_out, noise, say))
    if found is None:
        return list(steps), current
    alone, first, second = found
    pair = second.best
    less = pair.held_out.normalised_rms < current.held_out.normalised_rms
    # A second that adds little to the first is what that one's law lacks.
    worth = likelier(alone, pair, len(second.screened)) and told_apart_from(pair, alone)
    if not (worth and less and pair.score < current.score and told_apart_from(pair, current)):
        return list(steps), current
    say(f"{first.best.title} and {pair.title} instead: held-out {pair.held_out.normalised_rms:.3f} x noise")
    return steps_of_two(steps, place, first, second, base, (logs, held_out, noise, say)), pair


def steps_of_two(
    steps: Sequence[Step], place: int, first: Beside, second: Beside, base: Trial, refits: Refits
) -> list[Step]:
    """The steps in which that at a `place` has the best of the `first`, and a last one that of the `second` beside it."""
    (logs, held_out, noise, _), pair, step = refits, second.best, steps[place]
    others = tuple(trial for trial in step.trials if trial.id not in {*(t.id for t in first.ranked), pair.id})
    bare = without(first.best.id, pair, base, logs, held_out, noise)
    own = replace(
        step,
        trials=(*first.ranked, *others),
        equivalent=first.alike,
        laws=tuple(first.laws),
        laws_alike=(),
        instead=(bare, first.best),
    )
    before = without(pair.id, pair, base, logs, held_out, noise)
    last = Step(tuple(second.ranked), second.alike, tuple(second.screened), before, pair, tuple(second.laws))
    return [*(own if k == place else s for k, s in enumerate(steps)), last]
