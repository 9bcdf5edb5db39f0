"""The effects that a search found, as they are named: with their evidence, their parameters and what is not told apart."""

from collections.abc import Sequence
from dataclasses import replace

from ..effects.curve import SHAPE, Curve
from ..effects.table_constants import TableConstants
from ..estimate.result import Fit
from ..logs import LogSet
from ..robots.effect import Effect
from ..robots.robot import Robot
from ..robots.traits import axes_in_words
from .certainty.in_common import common_delay
from .named_effect import Evidence, NamedEffect, effect_parameters
from .policy import current_policy
from .search.needed import sure_of
from .search.same_curves import curves_that_are
from .search.steps import Search, Step
from .search.table_constants import Shares, changed_by, effects_that_are
from .where.shape import shapes_of

_AS_MUCH = 1.01
"""Ratio of what two models leave of the held-out logs up to which they leave the same."""


def _evidence(step: Step) -> Evidence:
    before, after = step.evidence
    rivals = [trial for trial in step.compared[1:] if trial.id not in step.equivalent]
    return Evidence(
        before=before.held_out.normalised_rms,
        after=after.held_out.normalised_rms,
        fit_gain=before.squares - after.squares,
        held_out_gain=before.held_out.squares - after.held_out.squares,
        looked_at=len(step.screened),
        refitted=len(step.trials),
        runner_up=rivals[0].id if rivals else None,
        margin=step.lead_over(rivals[0]) if rivals else None,
    )


def named_effects(found: Search, baseline: Fit, final: Fit) -> tuple[NamedEffect, ...]:
    """The added effects that are still in the final model, in the order of what they explained."""
    present = {effect.id: effect for effect in final.robot.effects}
    named = []
    for step in found.steps:
        effect = present.get(step.chosen.id)
        if effect is not None:
            own = effect_parameters(effect.id, effect.frees(final.robot), final.parameters)
            sure = effect.id in found.needed or sure_of(effect, step, baseline, final)
            same_law = effect.law == step.chosen.law
            named.append(
                NamedEffect(
                    id=effect.id,
                    where=effect.where,
                    formula=effect.formula + _which_axes(effect, final.robot),
                    parameters=own,
                    equivalent_to=_equivalent(effect, step, baseline.robot, final, found.after.by_chance),
                    evidence=_evidence(step),
                    identified=sure,
                    law=effect.law,
                    # A law may have been refitted more than once, from other starts or with a number held.
                    laws_alike=tuple(law for law in dict.fromkeys(step.laws_alike) if same_law and law != effect.law),
                    shapes=shapes_of(effect, final.robot, final.parameters) if isinstance(effect, Curve) else (),
                    constants=_wrong(effect, baseline, final),
                )
            )
    return tuple(sorted(named, key=lambda effect: -effect.evidence.fit_gain))


def _which_axes(effect: Effect, robot: Robot) -> str:
    """Which drive axes the numbers in the names of an effect's parameters are, where the robot says what these are called."""
    if not any(name.rpartition("_")[2].isdigit() for name in effect.parameters(robot)):
        return ""
    if not (robot.axis_words or len(robot.drive_axes) == 2):
        return ""
    return f" ({', '.join(f'{k} is {words}' for k, words in enumerate(axes_in_words(robot), start=1))})"


def _equivalent(effect: Effect, step: Step, bare: Robot, final: Fit, by_chance: bool) -> tuple[str, ...]:
    """The names that the data cannot tell from the effect's, those that are the same constants of the table, the one that makes
    everything as late as all are, and one that does the same to the robot: where it was not refitted to see that, is a formula
    beside a curve, or is what a chance that does not show (`by_chance`) comes to on average."""
    same = effects_that_are(effect.constants, bare) if isinstance(effect, TableConstants) else ()
    common = common_delay(effect, final)
    same = (*same, common.other) if common is not None else same
    other, refitted = effect.same_on(final.robot), {trial.id for trial in step.trials}
    scatters = bool(effect.draws(final.robot.parameters.numbers, final.robot))
    alike = not by_chance if scatters else effect.law == SHAPE or other not in refitted
    there = {own.id for own in final.robot.effects}
    same = (*same, other) if other and alike and other not in there else same
    same = (*same, *(name for name in _on_average(effect, step) if name not in same and name not in there))
    # What has been added since stands for itself.
    return (*(name for name in step.equivalent if name not in same and name not in there), *same)


def _on_average(effect: Effect, step: Step) -> tuple[str, ...]:
    """The refitted delays that differ from sample to sample of which the effect is the mean, where more than noise is left:
    what tells the two apart on the fitted logs is how these delays happened to come out."""
    left = step.chosen.held_out.normalised_rms
    if step.chosen.id != effect.id or left < current_policy().small:
        return ()
    return tuple(
        trial.id
        for trial in step.trials[1:]
        if trial.effect is not None
        and trial.effect.same_on(trial.robot) == effect.id
        and trial.effect.draws(trial.robot.parameters.numbers, trial.robot)
        and trial.held_out.normalised_rms < _AS_MUCH * left
    )


def or_the_same_curve(named: NamedEffect, step: Step, logs: LogSet) -> NamedEffect:
    """The name with those whose curves are the same function on the robot."""
    if named.law != SHAPE or step.after.id != named.id:
        return named
    most = max((candidate.gain for candidate in step.screened), default=0.0)
    least = current_policy().rival * most
    promised = [c.effect.id for c in step.screened if max(law.gain for law in (c, *c.laws)) > least]
    same = curves_that_are(step.before, step.after, promised, logs)
    return replace(named, equivalent_to=(*named.equivalent_to, *(n for n in same if n not in named.equivalent_to)))


def or_parts_of_others(named: Sequence[NamedEffect], robot: Robot) -> tuple[NamedEffect, ...]:
    """The names, those that may be a part of another one's mechanism, which its laws do not have, with that one's beside."""
    found = []
    for effect in named:
        others = [e.id for e in named if _may_be_part(effect.id, e.id, robot) and e.id not in effect.equivalent_to]
        found.append(replace(effect, equivalent_to=(*effect.equivalent_to, *others)))
    return tuple(found)


def parts_of_others(named: Sequence[NamedEffect], robot: Robot) -> tuple[str, ...]:
    """A sentence on each of the names that may be a part of another one's mechanism."""
    own = {effect.id: effect for effect in robot.effects}
    return tuple(
        f"What is called {effect.title} beside {other.title} may be a part of that: {own[other.id].why_also}."
        for other in named
        for effect in named
        if _may_be_part(effect.id, other.id, robot)
    )


def _may_be_part(one: str, of: str, robot: Robot) -> bool:
    return any(effect.id == of and one in effect.also_seen_as for effect in robot.effects)


def _wrong(effect: Effect, baseline: Fit, final: Fit) -> tuple[Shares, ...]:
    """Of constants of the table that were estimated after all, by which shares they differ from it."""
    constants = effect.constants if isinstance(effect, TableConstants) else ()
    return (changed_by(constants, baseline.robot, final.parameters),) if constants else ()
