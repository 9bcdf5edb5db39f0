"""Formulas in the place of curves that were chosen while other effects were missing, or that the first look promised more.

A first look asks every law from a model far off, where a formula's one number may explain nothing beside friction that has
given way. Beside all that was found, its robot's own numbers those that the curve leaves, it is asked again.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

from ...effects import laws_of
from ...effects.curve import Curve
from ...logs import LogSet
from ...robots.effect import Effect
from ..refits.candidate_refits import Report, all_added
from ..refits.refit import Trial, continued
from ..screening.screen import Candidate, screen
from .laws import best_first
from .reconsider import with_effects, with_trials, without
from .steps import Step, laws_in
from .telling_apart import alike, simplest_first
from .worth import holds_as_well

_MOST = 4
"""Most formulas that are tried at a time."""
_FAR = 0.1
"""Share of what is left with the curve by which a formula may leave more, on the fitted logs, and is followed up."""


def by_formulas(
    steps: Sequence[Step],
    current: Trial,
    base: Trial,
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> tuple[list[Step], Trial]:
    """The steps whose effect has a curve in `current` by a formula of its mechanism, or of one that the data cannot tell from
    it, where such a one does as well: of those that have not been tried beside all that was added."""
    revised = list(steps)
    for place, step in enumerate(steps):
        effect = next((own for own in current.robot.effects if own.id == step.chosen.id), None)
        if not isinstance(effect, Curve):
            continue
        present = {own.id for own in current.robot.effects}
        same = [t.id for t in step.trials[1:] if t.id in step.equivalent and isinstance(t.effect, Curve)]
        bare = unfitted_without(effect.id, current, base)
        tried: dict[str, list[Trial]] = {}
        # What was tried beside just this, and told from the curve, is told from it still.
        changed = laws_in(step.before.robot, effect.id) != laws_in(current.robot, effect.id)
        known = set() if changed else {trial.law for trial in step.laws}
        own_or_alike = [effect.id, *(name for name in same if name not in present)]
        # A curve of many heights stands for what it is not, too: a formula of whatever came near it while others were missing.
        rivals = [t.id for t in step.trials[1:] if t.id not in {*own_or_alike, *present}] if changed else []
        for identifiers in [*([name] for name in own_or_alike), *([rivals] if rivals else [])]:
            but = known if identifiers == [effect.id] else ()
            trials = _formulas(identifiers, but, bare, current, logs, held_out, noise, say)
            for trial in trials:
                if holds_as_well(trial, current):
                    tried.setdefault(trial.id, []).append(trial)
        own = best_first([replace(current, id=effect.id), *tried.pop(effect.id, [])])
        leading = simplest_first(
            sorted([own[0], *(best_first(o)[0] for o in tried.values() if o)], key=lambda t: t.score)
        )
        best = leading[0]
        if best.id == effect.id and best.law == effect.law:
            continue
        say(f"{best.title} instead of {effect.title}: held-out {best.held_out.normalised_rms:.3f} x noise")
        others = {trial.id: trial for trial in step.trials[1:] if trial.id != best.id}
        others |= {trial.id: trial for trial in leading[1:]}
        ranked = [best, *sorted(others.values(), key=lambda trial: trial.score)]
        step = with_trials(step, ranked)
        if best.id != effect.id:
            step = replace(step, instead=(without(effect.id, current, base, logs, held_out, noise), best))
        else:
            same_laws = tuple(trial.law for trial in alike(own))
            step = replace(step, laws=tuple(own), laws_alike=same_laws)
        revised[place], current = step, replace(best, id=current.id if best.id == effect.id else best.id)
    return revised, current


def most_promising(bare: Trial, laws: Sequence[Effect], logs: LogSet, noise: dict[str, float]) -> list[Candidate]:
    """Of the `laws` those few that promise most beside the model `bare`, the best first."""
    screened = screen(bare.robot, logs, laws, noise, bare.initial_states, bare.angles) if laws else []
    return sorted((law for own in screened for law in (own, *own.laws)), key=lambda law: -law.gain)[:_MOST]


def unfitted_without(identifier: str, current: Trial, base: Trial) -> Trial:
    """The model without one of its effects and not refitted: the other numbers are those beside it."""
    kept = {effect.id: current.robot for effect in current.robot.effects if effect.id != identifier}
    robot = with_effects(base.robot, kept)
    known = current.robot.parameters
    # Without the states of what is not there any more.
    states = {
        log: {name: value for name, value in own.items() if name in robot.states}
        for log, own in current.initial_states.items()
    }
    robot = robot.with_values(**{name: known[name].value for name in robot.parameters})
    return replace(current, robot=robot, initial_states=states)


def _formulas(
    identifiers: Sequence[str],
    but: Collection[str],
    bare: Trial,
    like: Trial,
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> list[Trial]:
    """The model `bare` with the most promising formulas of mechanisms `but` some, refitted from what suits its residual; those
    that come near what is left with the curve (`like`), to the end."""
    every = (law for name in identifiers for law in laws_of(bare.robot, name) if not law.repeats)
    formulas = (law for law in every if not isinstance(law, Curve))
    found = most_promising(bare, [law.blurred for law in formulas if law.law not in but], logs, noise)
    near = like.squares + _FAR * max(like.squares, float(like.fitted.samples))
    trials = all_added(bare, found, logs, held_out, noise, say)
    return [continued(trial, logs, held_out, noise) for trial in trials if trial.squares < near]
