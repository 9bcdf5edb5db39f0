"""The workflow from a fit to an explanation: is anything missing, where, what, how sure, and what next."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from .._compile import seldom_collected
from .._float64 import in_float64
from .._memory import bounded_memory
from .._origin import with_origin
from .._renamed import renamed
from ..checks.in_words import doubtful_units
from ..effects.catalogue import check_mechanisms
from ..effects.in_some_logs import InSomeLogs
from ..effects.table_constants import TableConstants
from ..estimate.output_error.conclude import Covariance
from ..estimate.output_error.contradicting import contradicting
from ..estimate.output_error.losses import Loss, Squares, loss_named
from ..estimate.output_error.one_way import one_way
from ..estimate.output_error.output_error import Windows, output_error
from ..estimate.output_error.predictability import predictability
from ..estimate.result import Fit, checked_fit
from ..logs import LogError, LogSet
from ..logs.useless import useless
from ..logs.windows import in_windows
from ..parameters import ParameterError
from ..robots.effect import Effect, in_words
from ..robots.given import given_logs
from .certainty.beyond_reach import going_on_beyond
from .certainty.finer_curves import hangs_on_forms
from .certainty.hinging import by_law, by_name, hinging, shapes_alone, with_the_rest
from .certainty.in_common import by_weight, delays_in_common, without_a_name
from .certainty.nominal_one import with_another_nominal
from .certainty.not_from_the_start import with_nothing_from_the_start
from .certainty.other_constants import likelier_constants
from .certainty.straight_shares import open_gain, shared_lines
from .certainty.taken_for_granted import taken_for_granted
from .explanation import Explanation
from .left.between_logs import changed_between
from .left.doubtful_logs import doubtful_logs
from .left.even_stamps import on_even_stamps
from .left.holes import cut_at_holes
from .left.lost_inputs import with_inputs_put_back
from .left.other_way import other_way
from .left.passing_jumps import ROBUST, jumps_are_much, without_passing_jumps
from .left.row_before import row_before
from .left.summed_speeds import on_summed_speeds
from .left.usable_readings import on_usable_readings
from .level import FALSE_ALARM, keeps_level
from .looked import Asked, looked
from .named_effects import named_effects, or_parts_of_others, or_the_same_curve, parts_of_others
from .next_experiment import NextExperiment, propose
from .not_looked_for import not_looked_for
from .policy import Policy, current_policy, keeps_policy
from .search.in_some_logs import in_some_of, sorted_logs, unsorted
from .search.reconsider import as_in_the_end, bare_of_the_end
from .search.said_of_constants import built_in, found_wrong, in_a_sentence
from .search.search import MOST_EFFECTS
from .search.steps import Search
from .search.table_constants import Shares, constants_as_well, constants_in_the_end, constants_like
from .search.telling_apart import same_but_later, supersets
from .smooth_friction import smoothed_friction
from .verdict import all_noise, doubted_on, doubts_of, of_another_form, still_doubted, verdict_of
from .where.localise import localise, without_place

_FREELY = "Fitted by free simulation to be explained: the windows of the first fit would have hidden what is missing."
_WEAK = 100.0
"""Lead over the runner-up (chi-squared) below which an experiment is proposed to confirm a name."""


def _next(found: Search, logs: LogSet) -> tuple[NextExperiment | None, str]:
    """An experiment for the first pair of names that this data leaves open or tells apart by little only, and a sentence about
    those that are open and that no experiment would tell apart."""
    untold = []
    for step in found.steps:
        best = step.chosen
        rivals = [t for t in step.trials[1:] if t.id not in supersets(step.trials)]
        open_ = [t for t in rivals if t.id in step.equivalent or step.lead_over(t) < _WEAK]
        if not open_:
            continue
        other = open_[0]
        names = f"{in_words(best.id)} and {in_words(other.id)}"
        if same_but_later(best, other, step.before):
            # The same motion, whatever is driven.
            untold.append(
                f"{names} are the same motion later, whatever is driven: only another sensor tells them apart."
            )
            continue
        proposal = propose(best, other, logs)
        if proposal:
            return proposal, ""
        if other.id in step.equivalent:
            untold.append(
                f"No drive that was tried, with inputs as large as those of the logs, would tell {names} apart once both are "
                "refitted; larger inputs, other loads or floors, or another sensor may."
            )
    sentences = (sentence[0].upper() + sentence[1:] for sentence in untold)
    return None, " ".join(sentences)


def _stages(found: Search) -> dict[str, float]:
    """The share of the gap that the best candidate of each stage of the signal path promises."""
    shares: dict[str, float] = {}
    for candidate in found.first_look:
        where = candidate.effect.where
        shares[where] = max(shares.get(where, 0.0), min(max(candidate.share, 0.0), 1.0))
    return shares


def apart(logs: LogSet, held_out: LogSet) -> None:
    """Raise `LogError` where a fitted and a held-out log have one name (what a fit knows of logs, it knows by name) or are one
    log under two names, which would confirm whatever was fitted."""
    shared = [name for name in held_out.names if name in logs.names]
    if shared:
        raise LogError(
            f"A fitted and a held-out log are both called {shared[0]!r}; give each its own name (a log is called like its "
            "file), and hold out logs that were not fitted."
        )
    fitted = {log.sha256: log.name for log in logs}
    copies = [(fitted[log.sha256], log.name) for log in held_out if log.sha256 in fitted]
    if copies:
        raise LogError(
            f"The fitted log {copies[0][0]!r} and the held-out log {copies[0][1]!r} hold the same numbers; hold out logs that "
            "were not fitted."
        )


def without_windows(
    fit: Fit,
    logs: LogSet,
    report: Callable[[str], None] = lambda message: None,
    *,
    loss: Loss | str = "squares",
    covariance: Covariance = "auto",
    windows: Windows = "auto",
) -> Fit:
    """`fit`, by free simulation if it was made in windows though no output's errors grow without bound.

    A window's own initial state takes up what the model lacks: of what merely integrates, that is what is looked for.
    Unstable plants, and those whose free simulation diverges, keep their windows, and so does whoever asked for `windows` of
    so many seconds. The other options are those of `output_error`.
    """
    if fit.window is None or isinstance(windows, int | float) or predictability(fit.robot, logs).kind == "unstable":
        return fit
    report("windows would hide what is missing; fitted by free simulation to be explained")
    start = {name: fit.robot.parameters[name].value for name in fit.free_names}
    try:
        free = output_error(fit.robot, logs, start=start, loss=loss, covariance=covariance, windows=None)
    except ParameterError:
        return fit
    return replace(free, notes=(*free.notes, _FREELY))


@renamed(check="held_out")
@with_origin
@bounded_memory()
@seldom_collected()
@in_float64
@keeps_level
@keeps_policy
def explain(
    fit: Fit,
    logs: LogSet,
    held_out: LogSet,
    *,
    effects: Sequence[Effect] = (),
    most: int = MOST_EFFECTS,
    loss: Loss | str = "squares",
    covariance: Covariance = "auto",
    windows: Windows = "auto",
    false_alarm: float = FALSE_ALARM,
    policy: Policy | None = None,
    report: Callable[[str], None] = lambda message: None,
) -> Explanation:
    """Say what is missing in `fit`, an output-error fit to `logs`, judged on logs that were not fitted (`held_out`).

    `effects` are further candidates beside the catalogue's, `most` the largest number of effects to add. `loss` and
    `covariance` are those of the fit with what was added (see `output_error`); with a robust loss, or where they make much
    of the held-out error, samples that jump away from their neighbours and come back are left out of the search, in the
    fitted and in the held-out logs (`passing_jumps`). Readings at the end of a sensor's range, and those of one that is
    dead in a log, are left out where they make much of the gap (`usable_readings`). Stamps that scatter about an even clock
    are evened where that predicts better (`even_stamps`), speeds that are differences of counts, which a controller answers,
    are explained by the positions that they add up to (`summed_speeds`), rows in which an input changed unseen are put back
    (`lost_inputs`), and logs in which many are missing are explained in parts (`holes`). `windows`: "auto" keeps those of
    an unstable plant only; seconds keep the fit's. `report` is called with a sentence whenever something is done. Of
    compiled programs no more are kept than `_memory.MOST_PROGRAMS`.

    Residuals are in units of the noise that the held-out logs show by themselves, as in `compare`. `false_alarm` is the share
    of complete models of which it may be said that something is missing (`docs/false_alarms.md` shows how well it is kept);
    `policy` holds the other numbers by which it decides.

    Which effects are refitted, and which is best, the fitted `logs` say alone; the `held_out` logs judge whether anything is
    missing and whether what ranked first is believed.

    What is coloured, follows nothing that drove the robot and no candidate explains (in whitened samples) is the sensors'
    noise, or said to be open (`colour`): nothing is missing for it.
    No name is the answer that leaves more than `policy.many` times the noise, or whose own parameters are not identified: the
    verdict is then "unexplained", with the `doubts` why. A robot that does not say which of its states forces accelerate
    is explained without `localisation`. A fit in windows of a plant that is not unstable is repeated without
    (`without_windows`).

    Raises `ParameterError` for a robot's `mechanisms` that no effect knows, `LogError` for logs of another robot, for a name
    that a fitted and a held-out log share, and where pre-flight finds an error in every fitted log (the robot never moved),
    `ValueError` for a `false_alarm` that is no share below a half, `TypeError` for a robot in the place of its fit.
    """
    logs, held_out = (given_logs(checked_fit(fit).robot, each) for each in (logs, held_out))
    apart(logs, held_out)
    check_mechanisms(fit.robot, effects)
    if why := useless(logs):
        raise LogError(why)
    loss = loss_named(loss)
    fit = without_windows(fit, logs, report, loss=loss, covariance=covariance, windows=windows)
    placeless = without_place(fit.robot)
    if placeless:
        report(placeless)
    fit, logs, held_out, unusable = on_usable_readings(fit, logs, held_out, report, loss=loss, covariance=covariance)
    fit, logs, held_out, parts = cut_at_holes(fit, logs, held_out, report, loss=loss, covariance=covariance)
    fit, logs, held_out, summed = on_summed_speeds(fit, logs, held_out, report, loss=loss, covariance=covariance)
    fit, logs, held_out, evened = on_even_stamps(fit, logs, held_out, report, loss=loss, covariance=covariance)
    logs, held_out, was_sorted = sorted_logs(fit, logs, held_out, report)
    with_gaps = logs, held_out
    fit, logs, held_out, put_back, estimated = with_inputs_put_back(
        fit, logs, held_out, report, loss=loss, covariance=covariance
    )
    recorded = logs, held_out
    if fit.window is not None:
        logs, held_out = in_windows(logs, fit.window), in_windows(held_out, fit.window)
        report(f"the fit is in windows of {fit.window:.3g} s, and so is its explanation")
    noted, whole = "", logs
    robust = not isinstance(loss, Squares)
    if robust or jumps_are_much(fit.robot, logs, held_out):
        logs, held_out, noted = without_passing_jumps(fit.robot, logs, held_out)
        whole, noted = (whole, noted) if robust else (logs, f"{noted} {ROBUST}")
        # Those are judged in the end where rows are missing: without what jumps, too.
        with_gaps = with_gaps[0], without_passing_jumps(fit.robot, *with_gaps)[1]
        report(noted)
    columns = other_way(fit, *recorded) or " ".join(contradicting(fit.robot, recorded[0]))
    if columns:
        report(columns)
    report("looking for a gap on the held-out logs")

    # No effect makes a column right whose sign or unit is another, and none that were added would be an answer.
    most = 0 if columns else most
    asked = Asked(fit, tuple(effects), most, loss, covariance, with_gaps if estimated else None, report)
    found, final, after, judging = looked(asked, logs, held_out, whole)
    plain = whole is logs and not (was_sorted or estimated)
    if plain and found.steps and not after.adequate and after.foretold > current_policy().small:
        # What is there in some logs only may show once the rest is named.
        again, others, was_sorted = sorted_logs(final, logs, held_out, report)
        if was_sorted:
            second = looked(asked, again, others, again)
            if second.after.normalised_rms < after.normalised_rms:
                logs, (found, final, after, judging) = again, second
            else:
                was_sorted = False
    held_out = judging
    rows = row_before(fit.robot, held_out, found.before)
    named = named_effects(found, fit, final)
    doubts = doubts_of(found, final, named, after)
    doubts += ("columns of the logs contradict the model by their signs or units",) if columns else ()
    verdict = verdict_of(found, named, most, doubts)
    smoothed = smoothed_friction(final.robot) if verdict != "adequate" else ""
    untried = not_looked_for(fit.robot) if verdict != "adequate" and not all_noise(found) else ""
    nothing = after.adequate or verdict == "adequate" or all_noise(found)
    # Held-out logs without a gap do not say why a fit failed; the fitted ones may.
    doubted = doubtful_logs(*recorded) if fit.failed or not nothing else doubtful_units(*recorded)
    unclear = verdict in ("named", "ambiguous") and named and not after.by_chance and not all_noise(found)
    final = of_another_form(final, named, after) if unclear else final
    still = still_doubted(final) if unclear else ""
    constants: dict[str, list[Shares]] = {}
    as_well: list[Shares] = []
    hinges = ""
    if verdict in ("named", "ambiguous"):
        report("looking whether constants of the table explain as much")
        steps = {step.chosen.id: step for step in found.steps}
        for effect in named:
            step, others = steps[effect.id], {}
            last = step is found.steps[-1]
            bare, with_it = as_in_the_end(step, found, logs, held_out)
            table = effect.id == TableConstants.id
            wrong = (constants_as_well if table else constants_like)(bare, with_it, logs, held_out)
            late = not (table or wrong)
            if late and found.final is not None:
                without = bare_of_the_end(effect.id, found.final, found.steps[0].before)
                own_end = replace(found.final, id=effect.id)
                wrong = constants_in_the_end(without, own_end, logs, held_out, found.before.noise)
            if table:
                as_well = [one.shares for one in wrong]
            else:
                constants[effect.id] = [one.shares for one in wrong]
            if last or late:
                others = {f"it is a wrong {' and '.join(one.shares)}": one.robot for one in wrong}
                if last and not table:
                    # Where another name was found better later on, the step's laws are not this effect's.
                    others |= by_law(effect, step) if step.after.id == effect.id else {}
            if found.final is not None:
                others = with_the_rest(others | by_name(effect, step), effect.id, final)
                own_effect = next(e for e in final.robot.effects if e.id == effect.id)
                final, sentence = hinging(final, found.final, others, shapes_alone(own_effect, final.robot))
                hinges = " ".join(filter(None, (hinges, sentence)))
        if found.final is not None:
            own = with_another_nominal(final, found.final, logs, held_out, found.before.noise, report)
            final, hinges = own.final, " ".join(filter(None, (hinges, own.sentence)))
            own = with_nothing_from_the_start(final, found.final, logs, held_out, found.before.noise, report)
            final, hinges = own.final, " ".join(filter(None, (hinges, own.sentence)))
            own = going_on_beyond(final, found.final, logs, held_out, found.before.noise, report)
            final, hinges = own.final, " ".join(filter(None, (hinges, own.sentence)))
        named = tuple(effect.as_in(final) for effect in named)
        named = tuple(
            e.or_constants(constants[e.id]) if e.id in constants else replace(e, constants=(*e.constants, *as_well))
            for e in named
        )
        named = tuple(or_the_same_curve(effect, steps[effect.id], logs) for effect in named)
        named = or_parts_of_others(named, final.robot)
        verdict = verdict_of(found, named, most, doubts)
    tables = tuple(in_a_sentence(identifier, sets, fit.robot) for identifier, sets in constants.items() if sets)
    contradicted = [effect.constants[0] for effect in named if effect.id == TableConstants.id]
    tables += tuple(found_wrong([shares, *as_well], fit.robot) for shares in contradicted)
    if found.final is not None:
        tables += tuple(likelier_constants(found.final, final, shares, logs) for shares in contradicted)
    if verdict in ("named", "ambiguous"):
        alone = {effect.id for effect in named if not constants.get(effect.id)}
        tables += built_in([effect for effect in final.robot.effects if effect.id in alone], fit.robot)
    localisation = None
    # Of what follows nothing that drove the robot, no force is looked for: it may be the sensor's noise.
    open_ = found.colour is not None and not found.colour.fed_back and not found.steps
    if verdict != "adequate" and not placeless and not open_:
        report("finding where simulation and data disagree")
        # Where names were found and are not the answer, the question is what is still missing.
        rest = verdict == "unexplained" and final is not fit and not after.diverged
        localisation = localise(
            *((final, held_out, after) if rest else (fit, held_out, found.before)), stages=_stages(found)
        )
    if found.steps:
        report("looking for the experiment that would tell more")
    proposal, untold = _next(found, logs)
    in_some = [effect for effect in final.robot.effects if was_sorted and isinstance(effect, InSomeLogs)]
    unlike = ""
    if verdict in ("named", "ambiguous"):
        unlike = " ".join(in_some_of(effect, logs, held_out, doubted=bool(still)) for effect in in_some)
    if was_sorted and not in_some:
        held_out = unsorted(held_out)
    changed = ""
    if verdict == "unexplained":
        final = doubted_on(final, after, doubts)
        changed = changed_between(fit, logs, held_out, report)
    # With prescribed angles there is no free simulation of the fitted logs.
    free = found.final is None or not found.final.angles
    told = free and (nothing or verdict in ("named", "ambiguous"))
    granted = taken_for_granted(final, logs, found.before.noise) if told else ""
    # What fitted logs hold that no model follows is missing, whatever held-out ones show.
    failed = verdict == "adequate" and fit.failed
    return Explanation(
        verdict="unexplained" if failed else verdict,
        effects=named,
        baseline=fit,
        final=final,
        before=found.before,
        after=after,
        search=found,
        held_out=held_out,
        localisation=localisation,
        next_experiment=proposal,
        doubts=doubts if verdict == "unexplained" else (),
        notes=tuple(
            note
            for note in (
                *tables,
                *hangs_on_forms(final),
                *shared_lines(final),
                open_gain(final),
                delays_in_common(final),
                *without_a_name(final),
                *by_weight(final),
                untold if verdict == "ambiguous" else "",
                granted,
                *(parts_of_others(named, final.robot) if verdict in ("named", "ambiguous") else ()),
                hinges,
                still,
                unusable,
                parts,
                summed,
                evened,
                unlike,
                put_back,
                placeless,
                noted,
                columns,
                rows,
                doubted,
                smoothed,
                untried,
                one_way(final, recorded[0]),
            )
            if note
        ),
        colour=found.colour,
        between_logs=changed,
    )
