"""What a search finds, the fit in full with what it found, and what that leaves on the held-out logs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

from ..estimate.output_error.conclude import Covariance
from ..estimate.output_error.losses import Loss
from ..estimate.output_error.lost_inputs import with_lost_inputs
from ..estimate.result import Fit
from ..logs import LogSet, noise_scale
from ..robots.effect import Effect
from .certainty.finer_curves import by_a_curve_instead, through_enough_points, widened_by_forms
from .certainty.straight_shares import without_shared_lines
from .left.heldout import HeldOut
from .left.overrated import small_after_all
from .left.rounded_inputs import within_input_rounding
from .left.rounding import within_rounding
from .left.within_errors import hanging, within_errors
from .named_effects import named_effects
from .refits.held_parameters import settled, with_parameters_held
from .refits.near_side import begun_on_the_near_side
from .refits.prescribed_angles import predicted
from .refits.refit import Trial, in_full
from .search.at_the_same_place import by_others_at_the_same_place
from .search.by_chance import by_chance
from .search.needed import only_needed, unsure_of
from .search.reconsider import by_its_curve
from .search.search import search
from .search.steps import Search


@dataclass(frozen=True)
class Asked:
    """What is asked of every look at some logs: the `fit` that may lack something, further `effects`, the `most` to add, the
    options of the fit with them, and whom to `report` to.

    `with_gaps` are the fitted and the held-out logs with the rows missing in which an input changed unseen, where the fit put
    these back: the model that has what was found says anew what was applied there.
    """

    fit: Fit
    effects: tuple[Effect, ...]
    most: int
    loss: Loss
    covariance: Covariance
    with_gaps: tuple[LogSet, LogSet] | None
    report: Callable[[str], None]


class Looked(NamedTuple):
    """What the search found, the fit with it, what that leaves on the `held_out` logs, and these."""

    found: Search
    final: Fit
    after: HeldOut
    held_out: LogSet


def looked(asked: Asked, logs: LogSet, held_out: LogSet, whole: LogSet) -> Looked:
    """The answer of one look at `logs`; the fit with what was found is to the `whole` ones, samples that jump included."""
    fit, report = asked.fit, asked.report
    found = search(fit, logs, held_out, effects=asked.effects, most=asked.most, report=report)
    # Fitted again with the weights of the search, the model may need nothing more.
    mended = found.after.adequate and not found.before.adequate
    if not ((found.steps or mended) and found.final):
        return Looked(found, fit, found.before, held_out)
    ended = begun_on_the_near_side(found.final, logs, held_out, found.before.noise, report)
    if ended is not found.final:
        found = replace(found, final=ended)
    report("fitting the model with what was added, and its standard errors")
    noise, lost = found.before.noise, None
    if asked.with_gaps is not None:  # as the model says that has what was found
        lost = with_lost_inputs(ended.robot, asked.with_gaps[0], noise)
        whole, held_out = lost.logs, with_lost_inputs(ended.robot, asked.with_gaps[1], noise).logs

    def finished(trial: Trial) -> Fit:
        own = in_full(trial, whole, noise, loss=asked.loss, covariance=asked.covariance)
        return without_shared_lines(lost.widened(own) if lost else own)

    def left_by(model: Fit) -> HeldOut:
        rated = noise_scale(held_out, otherwise=whole)
        left = small_after_all(predicted(model.robot, held_out, noise), held_out, rated)
        left = by_chance(model, logs, held_out, left)
        left = left if left.adequate else within_errors(model, held_out, left)
        left = within_input_rounding(model.robot, held_out, left) if found.after.inputs_rounded else left
        return hanging(model, held_out, within_rounding(held_out, left))

    final = finished(ended)
    after = left_by(final)
    found, final, after = only_needed(found, final, after, fit, held_out, finished, report)
    if after.adequate and found.final and len(found.steps) > 1 and (unsure := unsure_of(found, fit, final)):
        anew = by_others_at_the_same_place(found, unsure, asked.effects, logs, held_out, report)
        if anew.final is not None and anew.final is not found.final:
            found, final = anew, finished(anew.final)
            after = left_by(final)
    if found.final and not (_all_sure(found, fit, final) and settled(final)):
        held = with_parameters_held(found.final, logs, held_out, noise, report)
        if held is not found.final:
            found, final = replace(found, final=held), finished(held)
            after = left_by(final)
    base = found.steps[0].before if found.steps else None

    def curve_of(identifier: str, dense: bool = False) -> Trial | None:
        if base is None or found.final is None:
            return None
        own = by_its_curve(identifier, found.final, base, logs, held_out, noise, report, dense)
        return own and with_parameters_held(own, logs, held_out, noise, report)

    if after.adequate and found.final and not final.sound:
        instead = by_a_curve_instead(found, final, partial(curve_of, dense=True), finished, report)
        if instead.final is not final and left_by(instead.final).adequate:
            (found, final), after = instead, left_by(instead.final)
    if after.adequate and found.final and found.steps:
        finer = through_enough_points(found, final, finished, lambda own: _all_sure(found, fit, own), report)
        if finer.final is not final:
            (found, final), after = finer, left_by(finer.final)
    if found.steps and found.final and (after.adequate or final.sound):
        # Last, since another fit in full would have its own standard errors again.
        final = widened_by_forms(found, final, curve_of, finished, report)
    # What the fit in full leaves, and not what a search's few steps had left.
    return Looked(replace(found, after=after) if found.steps else found, final, after, held_out)


def _all_sure(found: Search, fit: Fit, final: Fit) -> bool:
    """Whether the data excludes of every effect that was added that there is none."""
    return all(effect.identified for effect in named_effects(found, fit, final))
