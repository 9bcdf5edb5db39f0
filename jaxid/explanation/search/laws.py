"""Which law of a mechanism: its other formulas, and its curve, refitted beside the one that promised most.

A mechanism is decided upon with all its laws, so that a wrong formula does not hide a right mechanism: where no law yet leaves
only noise, those of every mechanism that is in the running are tried.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...effects.catalogue import MECHANISMS
from ...effects.curve import SHAPE, Curve
from ..policy import current_policy
from ..refits.refit import Trial
from ..screening.screen import Candidate
from .telling_apart import alike, kinds_alike
from .worth import coarseness

NEARLY = 0.03
"""Share of what the best explains that another mechanism may lack by one law and be tried by others."""
Refits = Callable[[list[Candidate]], list[Trial]]


def other_laws(candidate: Candidate, curve: bool) -> list[Candidate]:
    """The laws of a mechanism that are worth a refit beside the `candidate`'s own; its `curve` only if asked for."""
    policy = current_policy()
    least = max(policy.formula * candidate.gain, 0.0) if candidate.effect.law != SHAPE else 0.0
    formulas = [c for c in candidate.laws if c.effect.law != SHAPE and c.gain > least]
    curves = [c for c in candidate.laws if c.effect.law == SHAPE and c.gain > candidate.gain]
    return formulas[: policy.most_laws] + (curves if curve else [])


def promises(candidate: Candidate, trial: Trial, gain: float) -> bool:
    """Whether another law of the mechanism than the `trial`'s promises more than the `gain` that keeps one in the running."""
    return any(law.gain > gain for law in (candidate, *candidate.laws) if law.effect.law != trial.law)


def _foremost(running: Sequence[Trial], first: Mapping[str, Candidate]) -> list[Trial]:
    """Those of the mechanisms in the running, best first, whose other laws are tried: as many as the policy allows, and the one
    of which a law that has not been tried promises most, however badly the one that was went."""
    kept = list(running[: current_policy().most_mechanisms])

    def promised(trial: Trial) -> float:
        laws = (first[trial.id], *first[trial.id].laws)
        return max((law.gain for law in laws if law.effect.law != trial.law), default=-np.inf)

    most = max(running, key=promised, default=None)
    return kept if most is None or most in kept else [*kept, most]


def by_law(
    candidates: Sequence[Candidate], trials: Sequence[Trial], near: float, refits: Refits, nothing: float = np.inf
) -> list[list[Trial]]:
    """The trials of each mechanism, best first, and mechanisms by their best; `refits` tries further candidates.

    `candidates` are those that the `trials` are of. `near` is the score up to which a mechanism is in the running. Where the
    best is a formula that leaves only noise, the question is only by which; else other mechanisms' laws may be better, and
    curves, also where the law that was tried came to `nothing`, the score without any effect.
    """
    ranked = sorted(trials, key=lambda trial: trial.score)
    # A curve follows other mechanisms' formulas, too, which are then tried first.
    settled = ranked[0].fitted.adequate and ranked[0].law != SHAPE
    first = {candidate.effect.id: candidate for candidate in candidates}
    running = [trial for trial in ranked if trial.score < near or promises(first[trial.id], trial, nothing - near)]
    running = _foremost(running, first)
    failed = [trial for trial in ranked if trial.score >= max(near, nothing) and trial not in running]
    open_ = ranked[:1] if settled else running + failed
    others = [(trial, law) for trial in open_ for law in other_laws(first[trial.id], curve=not settled)]
    further = [law for trial, law in others if law.effect.law != trial.law]
    found = {trial.id: [trial] for trial in ranked}
    for trial in refits(further) if further else []:
        found[trial.id].append(trial)
    if settled:
        # Another mechanism that explains nearly as much may do so as well by another of its laws.
        best = best_first(found[ranked[0].id])[0]
        same = alike([best, *ranked[1:]])
        least = best.score + NEARLY * (nothing - best.score)
        close = [trial for trial in ranked[1:] if trial.score < least and trial not in same]
        further = [law for trial in close for law in other_laws(first[trial.id], curve=False)]
        for trial in refits(further) if further else []:
            found[trial.id].append(trial)
    each = [best_first(own) for own in found.values()]
    return sorted(each, key=lambda own: own[0].score)


def with_the_same_curves(
    mechanisms: Sequence[Sequence[Trial]], screened: Sequence[Candidate], refits: Refits
) -> list[list[Trial]]:
    """The mechanisms with those besides whose curve has the formula of the best one's: where the curve bends, and not that one
    explains, tells two such mechanisms apart. Where the best one's are several that are alike, with the single curves of the
    other mechanisms, too."""
    found = [list(own) for own in mechanisms]
    leading = found[0][0]
    best = leading.effect
    if not isinstance(best, Curve):
        return found
    single = [own[0].id for own in found[1:] if len(best.kinds) > 1 and not best.agrees(leading.robot)]
    tried = {(trial.id, trial.law) for own in found for trial in own}
    laws = [law for candidate in screened for law in (candidate, *candidate.laws)]
    curves = [(law, law.effect) for law in laws if isinstance(law.effect, Curve)]
    same = {own.id: law for law, own in curves if own.formula == best.formula}
    same |= {own.id: law for law, own in curves if own.id in single and len(own.kinds) < len(best.kinds)}
    same |= {own.id: law for law, own in curves if own.id == best.rather and not best.agrees(leading.robot)}
    same |= {own.id: law for law, own in curves if own.id == best.may_as_well}
    further = [law for name, law in same.items() if (name, law.effect.law) not in tried]
    for trial in refits(further) if further else []:
        own = next((own for own in found if own[0].id == trial.id), None)
        if own is None:
            found.append([trial])
        else:
            own.append(trial)
    return sorted((best_first(own) for own in found), key=lambda own: own[0].score)


def with_the_same_law(
    mechanisms: Sequence[Sequence[Trial]], screened: Sequence[Candidate], refits: Refits
) -> list[list[Trial]]:
    """The mechanisms, with those refitted by the formula that the best one leaves only noise by: where a robot makes a force
    of a command by one factor, a limit of either is the same model, whatever another formula of it came to. So are the delays
    of commands and of sensors, whatever else is missing."""
    found = [list(own) for own in mechanisms]
    best = found[0][0]
    later = best.effect is not None and best.effect.only_later
    if best.law == SHAPE or not (best.fitted.adequate or later):
        return found
    tried = {(trial.id, trial.law) for own in found for trial in own}
    there = {own[0].id for own in found[1:]}
    laws = [law for candidate in screened for law in (candidate, *candidate.laws) if candidate.effect.id in there]
    same = [law for law in laws if law.effect.law == best.law and (law.effect.id, best.law) not in tried]
    same = [law for law in same if best.fitted.adequate or law.effect.only_later]
    for trial in refits(same[: current_policy().most_laws]) if same else []:
        next(own for own in found if own[0].id == trial.id).append(trial)
    return sorted((best_first(own) for own in found), key=lambda own: own[0].score)


def with_its_other_laws(
    mechanisms: Sequence[Sequence[Trial]], screened: Sequence[Candidate], refits: Refits
) -> list[list[Trial]]:
    """The mechanisms, with all that the first one has of other laws where none of those tried leaves only noise: what one
    promised beside another, to first order from a model far off, says little, and the next question would be what else is
    missing. Where a formula does, with those of no more parameters that promised as much as makes one worth a refit: it is said
    by which laws an effect may act, and one that was not tried is not said."""
    found = [list(own) for own in mechanisms]
    leading = found[0]
    best, tried = leading[0], {trial.law for trial in leading}
    every = [law for c in screened for law in (c, *c.laws) if law.effect.id == best.id]
    others = [law for law in every if law.effect.law not in tried and law.gain > 0]
    if best.fitted.adequate:
        if best.effect is None or best.law == SHAPE:
            return found
        formulas = [law.gain for law in every if law.effect.law != SHAPE]
        least, count = current_policy().formula * max(formulas, default=0.0), len(best.effect.parameters(best.robot))
        others = [law for law in others if law.effect.law != SHAPE and law.gain > least]
        others = [law for law in others if len(law.effect.parameters(best.robot)) <= count]
    if others:
        found[0] = best_first([*leading, *refits(others)])
    return found


def with_formulas_of_others(
    mechanisms: Sequence[Sequence[Trial]], likely: Sequence[Candidate], refits: Refits
) -> list[list[Trial]]:
    """The mechanisms, with those besides that promised a good part of what the most promising one did and were not refitted,
    by a formula, where the best is a curve that leaves more than noise: a curve of many heights stands for what it is not, and
    what a formula does from far off, friction giving way to it, the first order does not foretell."""
    found = [list(own) for own in mechanisms]
    best, policy = found[0][0], current_policy()
    if best.law != SHAPE or best.fitted.adequate:
        return found
    there, least = {own[0].id for own in found}, policy.promising * likely[0].gain
    further: list[Candidate] = []
    for candidate in likely:
        own = [law for law in (candidate, *candidate.laws) if law.effect.law != SHAPE and law.gain >= least]
        if own and candidate.effect.id not in there and not candidate.effect.repeats:
            further.append(own[0])
    tried = refits(further[: policy.most_refits]) if further else []
    return sorted([*found, *([trial] for trial in tried)], key=lambda own: own[0].score)


def rather_of(trial: Trial) -> str | None:
    """The mechanism that a trial's curve is rather of, where it does not bend as its own does, or that a law without a formula
    takes on as well."""
    effect = trial.effect
    if effect is None or (isinstance(effect, Curve) and effect.agrees(trial.robot)):
        return None
    return effect.rather or None


def with_what_it_rather_is(
    mechanisms: Sequence[Sequence[Trial]],
    screened: Sequence[Candidate],
    refits: Refits,
    finer: Callable[[Trial], Trial],
) -> list[list[Trial]]:
    """The mechanisms, with the one that the best one's curve is rather of by all its laws, and its curves as `finer` makes
    them: one for each motor or axis, where the best one's acts on one alone."""
    found = [list(own) for own in mechanisms]
    whose = rather_of(found[0][0])
    if whose is None:
        return found
    there = next((own for own in found if own[0].id == whose), [])
    tried = {trial.law for trial in there}
    candidates = (candidate for candidate in screened if candidate.effect.id == whose)
    laws = [law for candidate in candidates for law in (candidate, *candidate.laws)]
    further = refits([law for law in laws if law.effect.law not in tried and law.gain > 0])
    own = [finer(trial) for trial in (*there, *further)]
    if own:
        found = [other for other in found if other is not there] + [best_first(own)]
    return sorted(found, key=lambda own: own[0].score)


def by_where_they_bend(mechanisms: Sequence[list[Trial]], base: Trial) -> list[list[Trial]]:
    """The mechanisms, best first; where the best curve is rather that of another mechanism, which explains the gap of `base`,
    too, that one first. Of several curves that are alike, a mechanism of fewer that explains the gap or nearly as much comes
    first."""
    ranked, passed = list(mechanisms), set[str]()
    while (own := _rather(ranked, base)) is not None and own[0].id not in passed:
        passed.add(ranked[0][0].id)
        ranked = [own, *(other for other in ranked if other is not own)]
    return ranked


def _rather(ranked: Sequence[list[Trial]], base: Trial) -> list[Trial] | None:
    """The mechanism that the first one's curve is rather of: of the same formula, with a curve that is its own or, where the
    first says whose it is, by any law that explains as much."""
    best = ranked[0][0]
    if not isinstance(best.effect, Curve) or best.effect.agrees(best.robot):
        return None
    closed = current_policy().unexplained * base.fitted.gap
    nearly = best.fitted.gap + coarseness(True, base.fitted)
    for own in ranked[1:]:
        effect, gap = own[0].effect, own[0].fitted.gap
        named = effect is not None and effect.id == best.effect.rather
        if isinstance(effect, Curve):
            same = (named or effect.formula == best.effect.formula) and effect.agrees(own[0].robot)
        else:
            same = named
        if (same and gap < closed) or (kinds_alike(best, own[0]) and gap < max(closed, nearly)):
            return own
    return None


def best_first(own: Sequence[Trial]) -> list[Trial]:
    """Trials of one mechanism's laws, best first; of those that the data cannot tell from the best, the simplest comes first,
    and of equally simple ones the more usual."""
    own = sorted(own, key=lambda trial: trial.score)
    if len(own) < 2:
        return own
    usual = next(([law.law for law in laws] for laws in MECHANISMS if laws[0].id == own[0].id), [])
    same = [own[0], *(trial for trial in alike(own) if trial.law in usual)]
    first = min(same, key=lambda trial: (trial.free, usual.index(trial.law) if trial.law in usual else 0))
    return [first, *(trial for trial in own if trial is not first)]
