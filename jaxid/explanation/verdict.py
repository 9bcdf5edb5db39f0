"""What an explanation is worth: why names are no answer, its verdict, and doubts about the model that it ends with."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..effects.curve import SHAPE, Curve, is_jagged
from ..estimate.result import Fit
from ..robots.effect import Effect
from .certainty.straight_shares import open_gain
from .explanation import Verdict
from .left.heldout import HeldOut
from .named_effect import NamedEffect
from .policy import current_policy
from .search.steps import Search

_MOST = 0.5
"""Share of a gap, however small, of which a name that leaves more is no answer."""


def doubts_of(found: Search, final: Fit, named: Sequence[NamedEffect], after: HeldOut) -> tuple[str, ...]:
    """Why the names that were found are not the answer: each reason in a sentence; empty where they may be."""
    doubts = []
    if after.diverged:
        doubts.append(f"the simulation diverges on {', '.join(after.diverged)}")
    elif after.foretold > current_policy().many and not (after.adequate or all_noise(found)):
        doubts.append(f"the held-out error is still {after.normalised_rms:.3g} times the noise")
    elif len(named) > 1 and _more_than_imprecise(named, final, after) and not (all_noise(found) or _closing(found)):
        doubts.append(
            f"with {len(named)} effects the held-out error is still {after.normalised_rms:.3g} times the noise, so that one "
            "may stand for what another's law lacks"
        )
    if final.judgement is not None and final.failed:
        doubts.append(
            f"the model does not follow the logs it was fitted to ({final.judgement.sentences[0].rstrip('.')})"
        )
    if named and final.window is not None and final.judgement is not None and final.judgement.follows:
        # Windows' own initial states take up what is slow: what little is left tells more there than its size does.
        follows = ", ".join(final.judgement.follows)
        doubts.append(f"what is left in {follows} still follows the motion, though every window begins anew")
    enough = after.adequate or all_noise(found)
    for effect in named:
        # One of several names that explain it all alike: that there is one of them is sure, though no size of either is.
        if not effect.identified and not (enough and effect.equivalent_to):
            doubts.append(f"the errors of {effect.title} do not exclude that there is none")
    identified = any(final[name].status == "identified" for name in final.free_names)
    if len(named) > 1 and not identified and not open_gain(final):
        doubts.append("no parameter of the model with it is identified: the effects stand in for one another")
    doubts += [f"{effect.title} is hardly it: {why}" for effect, why in _none_of_theirs(final, named)]
    return tuple(doubts)


def _none_of_theirs(final: Fit, named: Sequence[NamedEffect]) -> list[tuple[NamedEffect, str]]:
    """The names whose curves, or numbers, are none that they may have, and why; but for those that are said to be as well the
    name whose they are."""
    own = {effect.id: effect for effect in final.robot.effects}
    every = [(effect, own[effect.id]) for effect in named if effect.id in own]
    there = [(e, law) for e, law in every if not (isinstance(law, Curve) and law.rather in e.equivalent_to)]
    return [(e, why) for e, law in there if (why := law.doubt(final.robot) or _jagged(law, final))]


def _jagged(law: Effect, final: Fit) -> str:
    """What is wrong with a curve that goes up and down as no law of its variable does; else empty."""
    if not isinstance(law, Curve) or law.wanders:
        return ""
    for name in law.each(final.robot):
        own = [final[law.height(place, name)] if place in law.varying else None for place in range(len(law.places))]
        heights = np.array([e.value if e is not None else 0.0 for e in own])
        errors = np.array([e.std_error if e is not None else 0.0 for e in own])
        if is_jagged(heights, errors):
            return f"its curve goes up and down again and again over {law.variable}"
    return ""


def _more_than_imprecise(named: Sequence[NamedEffect], final: Fit, after: HeldOut) -> bool:
    """Whether more is left than what laws near the right ones leave of their own; than what a curve does where the fit with
    them is not poor."""
    policy = current_policy()
    poor = final.judgement is not None and final.judgement.verdict == "poor"
    curve = not poor and any(effect.law == SHAPE for effect in named)
    return not after.adequate and after.foretold > (policy.coarse_curve if curve else policy.coarse_law)


def _closing(found: Search) -> bool:
    """Whether every effect after the first leaves of the gap that it found no more than an imprecise law does: what stands for
    another's law makes up for a part of it."""
    share, later = 2.0 * current_policy().coarse_share, found.steps[1:]
    return bool(later) and all(step.after.held_out.gap <= share * step.before.held_out.gap for step in later)


def all_noise(found: Search) -> bool:
    """Whether what the search leaves is coloured noise such as a sensor's filter makes, and nothing else."""
    return found.colour is not None and found.colour.only_noise


def verdict_of(found: Search, named: Sequence[NamedEffect], most: int, doubts: Sequence[str]) -> Verdict:
    before, after = found.before, found.after
    enough = after.adequate or all_noise(found)
    if not found.steps and enough:
        return "adequate"
    if doubts:
        return "unexplained"
    policy = current_policy()
    share = (after.foretold - 1.0) / max(before.gap, 1e-9)
    # Little that is left is a law's imprecision only where the name has explained most of it.
    left = share > policy.unexplained and (after.foretold > policy.small or share > _MOST)
    # As many effects as may be added and still more left than imprecise ones leave: they stand in for something else.
    # What is left of the first gap is less than any further effect has to close.
    little = after.foretold <= policy.small or share <= policy.least_of_first
    used_up = len(named) >= most > 1 and not little
    if not named or (not enough and (left or used_up)):
        return "unexplained"
    return "ambiguous" if any(effect.equivalent_to for effect in named) else "named"


def of_another_form(final: Fit, named: Sequence[NamedEffect], after: HeldOut) -> Fit:
    """`final`, of a poor model where what was named leaves more of held-out logs than laws near the right ones would."""
    if final.judgement is None or not final.judgement.trustworthy or not _more_than_imprecise(named, final, after):
        return final
    sentence = (
        f"It leaves {after.normalised_rms:.3g} times the noise on held-out logs: what was named has another form, or more is "
        "missing, and parameters may be off by several of their standard errors."
    )
    return replace(final, judgement=replace(final.judgement.doubted(sentence), better=""))


def still_doubted(final: Fit) -> str:
    """What the residual says of the fit with all that was added, where it is poor or failed, or that it ended at no minimum;
    else empty."""
    doubt = final.judgement.doubt if final.judgement is not None else ""
    if not (doubt or final.converged):
        doubt = (
            f"Its search ended at no minimum ({final.reason.split(';')[0]}): numbers may be off by several of their standard "
            "errors."
        )
    return f"The fit with what was added is itself to be doubted. {doubt}" if doubt else ""


def doubted_on(final: Fit, after: HeldOut, doubts: Sequence[str] = ()) -> Fit:
    """`final`, which is no answer: of a poor model where it does not explain what it leaves on held-out logs (`after`), however
    well it fits its own, or where there are `doubts` about what was added to it.

    What a wrong model's parameters are on the fitted logs, no standard error says of the robot.
    """
    if final.judgement is None or not final.judgement.trustworthy:
        return final
    if after.adequate:
        if not (final.robot.effects and doubts):
            return final
        sentence = f"What was added is no answer, since {'; '.join(doubts)}: the parameters hold beside it alone."
    elif after.normalised_rms > final.judgement.normalised_rms:
        rms = "diverges on" if after.diverged else f"leaves {after.normalised_rms:.3g} times the noise on"
        sentence = (
            f"The model {rms} held-out logs ({final.judgement.normalised_rms:.2f} on its own): something is missing, and its "
            "parameters may be far off, by more than their standard errors."
        )
    else:
        return final
    return replace(
        final, judgement=replace(final.judgement.doubted(sentence), better=""), notes=(sentence, *final.notes)
    )
