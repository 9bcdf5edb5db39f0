"""The next name: the shortlist refitted, each mechanism by its best law, and the best one, if it is worth its price."""

from collections.abc import Sequence

import numpy as np

from ...effects.curve import SHAPE
from ...effects.table_constants import TableConstants
from ...logs import LogSet
from ...robots.robot import Robot
from ..policy import current_policy
from ..refits.candidate_refits import Report, all_added
from ..refits.held_parameters import with_parameters_held
from ..refits.refit import Trial, continued, refit_from_itself
from ..screening.screen import Candidate, alike_to
from .colour_left import explaining, ranked_in_colour
from .denser import densest
from .freer_forms import as_well_by_a_freer_form
from .from_the_best import from_the_best
from .laws import (
    best_first,
    by_law,
    by_where_they_bend,
    with_formulas_of_others,
    with_its_other_laws,
    with_the_same_curves,
    with_the_same_law,
    with_what_it_rather_is,
)
from .order import by_what_holds, rather_first, with_more
from .steps import Step
from .table_constants import constants_instead
from .telling_apart import alike, not_told_apart, simplest_first, supersets
from .worth import coarseness, in_the_running, least_gain, undone, worth_it

_MOST_ALIKE = 4
_FIRST_TRIALS = 2
_FAR = 10.0
"""Times the noise from which a residual is no first order of what is missing: a curve then bends on its way to the optimum, and
what a formula comes to is another matter."""
_FORMULAS = 2
"""Formulas of a mechanism that are then refitted beside its curve."""
_FROM_COLOUR = 2
"""Most candidates that are refitted only because they explain the whitened residual."""


def _different(likely: Sequence[Candidate]) -> list[Candidate]:
    """The most promising candidates, one of each that explain alike.

    Those with prescribed wheels' angles promise more than the others can; they come on top and displace none.
    """
    prescribed = [candidate for candidate in likely if candidate.effect.repeats]
    others = [candidate for candidate in likely if candidate not in prescribed]
    chosen: list[Candidate] = []
    policy = current_policy()
    for candidate in others:
        enough = len(chosen) >= policy.first_refits and candidate.gain < policy.promising * others[0].gain
        if enough or len(chosen) == policy.most_refits:
            break
        if not any(candidate.like(other) for other in chosen):
            chosen.append(candidate)
    return chosen + [candidate for candidate in prescribed if candidate.gain >= policy.promising * likely[0].gain]


def _formulas_of(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Of every mechanism that promised most by its curve the formulas that promise most."""
    formulas = [
        [law for law in c.laws if law.effect.law != SHAPE and law.gain > 0] for c in candidates if c.effect.law == SHAPE
    ]
    return [law for own in formulas for law in sorted(own, key=lambda law: -law.gain)[:_FORMULAS]]


def _best(candidates: Sequence[Candidate], trials: Sequence[Trial]) -> tuple[Candidate, Trial]:
    """The candidate that did best, and its trial."""
    best = min(trials, key=lambda trial: trial.score)
    return next(candidate for candidate in candidates if candidate.effect.id == best.id), best


def _as_near(trials: Sequence[Trial], base: Trial) -> list[str]:
    """The ids of those that explain as much as a curve that is the answer: its few points are no evidence against them."""
    best = trials[0]
    closed = best.fitted.gap < current_policy().unexplained * base.fitted.gap
    if not closed or best.law != SHAPE:
        return []
    far = best.fitted.normalised_rms + coarseness(True, base.fitted)
    return [trial.id for trial in trials[1:] if trial.fitted.normalised_rms < far]


def _untried(trials: Sequence[Trial], likely: Sequence[Candidate]) -> list[Candidate]:
    """The candidates that explain like the first of the trials and were not refitted, since another one led until last."""
    return alike_to(trials[0].id, likely, {trial.id for trial in trials})[:_MOST_ALIKE]


def name_next(
    base: Trial,
    first: Trial,
    screened: Sequence[Candidate],
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> Step | None:
    """The best effect to add to `base` of those `screened`, None if none explains enough."""
    likely = [c for c in screened if c.gain > 0]
    say("first look: " + (", ".join(f"{c.effect.id} {100 * c.share:.0f} %" for c in likely[:6]) or "no candidate"))
    if not likely:
        return None
    shortlist = _different(likely)
    # What coloured noise has hidden from the first order.
    shortlist += [c for c in explaining(screened)[:_FROM_COLOUR] if c not in shortlist]
    trials = all_added(base, shortlist[:_FIRST_TRIALS], logs, held_out, noise, say)
    leader, best = _best(shortlist, trials)
    policy = current_policy()
    least = policy.rival * leader.gain if best.fitted.adequate else -np.inf
    shortlist = [c for c in shortlist if c.gain >= least or c in shortlist[:_FIRST_TRIALS]]
    trials += all_added(base, shortlist[_FIRST_TRIALS:], logs, held_out, noise, say, trials)
    leader, _ = _best(shortlist, trials)
    # Of one that ran away nothing is known; who explains like it has not been asked then.
    lost = {trial.id for trial in trials if not np.isfinite(trial.score)}
    led = [leader, *(c for c in shortlist if c.effect.id in lost)]
    # Nor has one that promises as much as the leader and was left out for a third that it is like.
    as_much = (1.0 - policy.in_the_running) * leader.gain
    alike_to_it = [c for c in likely if c not in shortlist and (c.gain >= as_much or any(c.like(own) for own in led))]
    alike_to_it = alike_to_it[:_MOST_ALIKE]
    trials += all_added(base, alike_to_it, logs, held_out, noise, say, trials)
    if base.fitted.normalised_rms > _FAR:
        plain = all_added(base, _formulas_of([*shortlist, *alike_to_it]), logs, held_out, noise, say)
        trials = [min((t, *(p for p in plain if p.id == t.id)), key=lambda one: one.score) for t in trials]
    best, near = min(trials, key=lambda t: t.score), in_the_running(trials, base)
    promising = base.fitted.normalised_rms - best.fitted.normalised_rms > 0.5 * least_gain(base, first)

    def to_the_end(tried: Sequence[Trial]) -> list[Trial]:
        running = [t for t in tried if promising and t.score < near]
        ended = {}
        for number, trial in enumerate(running, start=1):
            say(f"refitting to the end with {trial.title}, {number} of {len(running)}")
            ended[id(trial)] = continued(trial, logs, held_out, noise)
        return [ended.get(id(t), t) for t in tried]

    def added(further: Sequence[Candidate]) -> list[Trial]:
        return to_the_end(all_added(base, further, logs, held_out, noise, say))

    def again(robot: Robot, like: Trial) -> Trial:
        return refit_from_itself(robot, like, logs, held_out, noise)

    mechanisms = by_law([*shortlist, *alike_to_it], to_the_end(trials), near, added, base.score)
    mechanisms = with_the_same_curves(mechanisms, screened, added)
    mechanisms = sorted(with_its_other_laws(mechanisms, screened, added), key=lambda own: own[0].score)
    if not mechanisms[0][0].fitted.adequate:
        leading, others = mechanisms[:_FIRST_TRIALS], mechanisms[_FIRST_TRIALS:]
        leading = [[densest(trial, again) for trial in own] for own in leading]
        mechanisms = sorted((best_first(own) for own in [*leading, *others]), key=lambda own: own[0].score)
        # Another curve may lead than before: what stands beside it has as many points.
        mechanisms = with_the_same_curves(
            mechanisms, screened, lambda further: [densest(trial, again) for trial in added(further)]
        )
    mechanisms = with_what_it_rather_is(mechanisms, screened, added, lambda trial: densest(trial, again))
    mechanisms = with_formulas_of_others(by_where_they_bend(mechanisms, base), likely, added)
    mechanisms = with_its_other_laws(mechanisms, screened, added)
    mechanisms = with_the_same_law(mechanisms, screened, added)
    mechanisms = from_the_best(mechanisms, screened, logs, held_out, noise, say)
    mechanisms = by_what_holds(mechanisms, base)
    trials = [own[0] for own in mechanisms]
    rather = trials[0].id
    tried = _looked_at(screened, trials[0])
    in_colour = ranked_in_colour(base, trials, first, tried, logs, held_out, noise)
    refused: list[Trial] = []
    if in_colour is None:
        trials = [_not_undone(trial, base, logs, held_out, noise) for trial in simplest_first(trials)]
        mechanisms = [[next((t for t in trials if t.id == own[0].id), own[0]), *own[1:]] for own in mechanisms]
        # What does not hold on the held-out logs explains nothing, however well it was fitted; the next one may.
        held = [
            worth_it(base, trial, first, _looked_at(screened, trial)) and not undone(trial, base, held_out, noise)
            for trial in trials
        ]
        worth = any(held)
        leading = held.index(True) if worth else 0
        refused, trials = trials[:leading], trials[leading:]
        more = added(_untried([*trials, *refused], likely)) if worth else []
        more = [trial for trial in more if worth_it(base, trial, first, _looked_at(screened, trial))]
        mechanisms = [*mechanisms, *([trial] for trial in more)]
        trials = simplest_first(with_more(trials, more)) if more else trials
        freely = as_well_by_a_freer_form(trials, base, again) if worth else {}
        trials = [freely.get(trial.id, trial) for trial in trials]
        equivalent = tuple(name for name in not_told_apart(trials, base) if name not in supersets(trials))
    else:
        trials, equivalent, worth = in_colour
    near_too = [name for name in _as_near(trials, base) if name not in supersets(trials)]
    equivalent = (*equivalent, *(name for name in near_too if name not in equivalent))
    trials, equivalent = rather_first(trials, equivalent, rather)
    for trial in (*trials, *refused):
        say(
            f"refitted with {trial.title}: held-out {trial.held_out.normalised_rms:.3f} x noise, score {trial.score:.0f}"
        )
    if not worth:
        return None
    laws = next(own for own in mechanisms if own[0].id == trials[0].id)
    same = tuple(trial.law for trial in alike(laws))
    ids = tuple(trial.id for trial in refused)
    return Step((*trials, *refused), equivalent, tuple(screened), base, trials[0], tuple(laws), same, ids)


def or_constants(
    found: Step | None,
    base: Trial,
    first: Trial,
    screened: Sequence[Candidate],
    logs: LogSet,
    held_out: LogSet,
    say: Report,
) -> Step | None:
    """The step as it was found, or that to right values of the table where no formula reaches the noise and they do better."""
    best = found.chosen if found is not None else None
    settled = best is not None and best.fitted.adequate and best.law != SHAPE
    if settled or (best is not None and best.in_colour is not None):
        return found
    if any(effect.id == TableConstants.id for effect in base.robot.effects):
        return found
    say("looking whether constants of the table explain more")
    trial = constants_instead(base, best, logs, held_out)
    if trial is None or not worth_it(base, trial, first, max(len(screened), 1)):
        return found
    say(f"refitted with other constants of the table: held-out {trial.held_out.normalised_rms:.3f} x noise")
    trials = (trial, *(found.trials if found is not None else ()))
    equivalent = tuple(name for name in not_told_apart(trials) if name not in supersets(trials))
    return Step(trials, equivalent, tuple(screened), base, trial, (trial,))


def _not_undone(trial: Trial, base: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> Trial:
    """The trial, of a sensor's effect that the rest of the model undoes with what that may hold held, where nothing undoes it
    then: a scale that all sensors share is another mass and other friction, and a refit ends anywhere along it."""
    if trial.effect is None or not trial.effect.may_hold(trial.robot) or not undone(trial, base, held_out, noise):
        return trial
    again = with_parameters_held(trial, logs, held_out, noise)
    return trial if undone(again, base, held_out, noise) else again


def _looked_at(screened: Sequence[Candidate], trial: Trial) -> int:
    """How many candidates were looked at: laws, and the shapes of the one that was chosen."""
    laws = [law for candidate in screened for law in (candidate, *candidate.laws)]
    return len(laws) * next((c.out_of for c in laws if (c.effect.id, c.effect.law) == (trial.id, trial.law)), 1)
