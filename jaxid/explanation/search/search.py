"""Naming: refit the shortlist, rank by likelihood on the fitted logs, go on until nothing but noise is left or nothing helps.

Which names compare with which, and which is best, the fitted logs say alone. The held-out logs judge: whether anything is
missing, and whether what ranked first is believed.
"""

from collections.abc import Sequence
from dataclasses import replace

from ...estimate.judgement import Judgement
from ...estimate.result import Fit
from ...logs import LogSet, noise_scale
from ...robots.effect import Effect
from ...simulation.scaled import scaled_to
from ..left.coloured import OnlyColour
from ..left.heldout import held_out_state
from ..left.overrated import in_its_own_noise, small_after_all
from ..left.rounded_inputs import within_input_rounding
from ..left.rounding import within_rounding
from ..left.within_errors import within_errors
from ..policy import current_policy
from ..refits.candidate_refits import Report
from ..refits.fine_steps import ranked_with_fine_steps
from ..refits.refit import Trial, refit
from ..screening.first_look import begun_at, first_look
from ..screening.screen import Candidate
from .between_rows import ranked_between_rows
from .by_chance import rather_by_chance
from .colour_left import colour_left, explained_somewhere, generalised_trial, inputs_left, noise_fed_back
from .formula_and_another import by_a_formula_and_another
from .formulas import by_formulas
from .from_the_back import named_from_the_back, not_present
from .given_up import not_given_up
from .little_more import with_the_little_more
from .next_name import name_next, or_constants
from .plainer_laws import by_plainer_laws, with_a_plainer_law
from .reconsider import by_laws_again, exchanged, pruned, pruned_in_the_end, rather_by_curves, reconsidered
from .steps import Search, Step
from .two_formulas import by_two_formulas
from .worth import could_matter

MOST_EFFECTS = 3
_SURE, _MUCH = 1e-9, 5.0
"""Probability of chance below which the mark of a force in what a fit leaves is none, and standard errors by which it moves a
parameter that count."""


def _beyond_chance(judgement: Judgement) -> bool:
    chance, moved = judgement.marked
    return chance < _SURE and moved > _MUCH


def search(
    fit: Fit,
    logs: LogSet,
    held_out: LogSet,
    *,
    effects: Sequence[Effect] = (),
    most: int = MOST_EFFECTS,
    report: Report = lambda message: None,
) -> Search:
    """Add effects to a fitted model as long as they explain something. `effects` are further candidates."""
    noise = rated = noise_scale(held_out, otherwise=logs)
    fit = replace(fit, robot=scaled_to(fit.robot, logs))
    state = in_its_own_noise(fit, held_out, held_out_state(fit.robot, held_out, noise))
    noise = rated | state.noise
    if not state.adequate:
        state = within_rounding(held_out, within_errors(fit, held_out, state))
    passed = state = within_input_rounding(fit.robot, held_out, state)
    # The held-out logs may be too few to show it.
    if fit.judgement is not None and fit.judgement.follows:
        state = replace(state, but_fitted=True)
    if fit.judgement is not None and _beyond_chance(fit.judgement) and state.p_value < state.false_alarm:
        # Little as it changes what is predicted, it is what the parameters are wrong by.
        state = replace(state, but_fitted=True, negligible=0.0)
    if state.adequate:
        return Search(passed, passed, None, (), ())
    report(f"held-out error {state.normalised_rms:.3f} x noise; fitting again with the held-out logs' noise")
    # With the same weights as the refits, so that likelihoods compare.
    start = {name: fit.robot.parameters[name].value for name in fit.free_names}
    baseline = refit(fit.robot, [start], logs, held_out, noise, fit.initial_states)
    if passed.adequate:
        baseline = baseline.leaving(replace(baseline.held_out, but_fitted=True, negligible=state.negligible))
    current = baseline
    begun = begun_at(fit)
    looked_at: tuple[Candidate, ...] = ()
    steps: list[Step] = []
    first: tuple[list[Step], Trial] | None = None
    stuck: tuple[list[Step], Trial] | None = None
    colour, confirmed = None, set[str]()
    for last in (False, True):
        # Beside delays that scatter, a smaller effect may still show on the fitted logs.
        while not current.held_out.adequate or current.held_out.by_chance:
            colour = colour_left(current, logs, held_out, noise)
            if not could_matter(current, baseline):
                colour = None  # too little to be looked at any further
                break
            full = _added(current, baseline) >= most or len(steps) > most
            if colour is None and full:
                break
            remaining = not_present(current.robot, effects, logs)
            count = len({effect.id for effect in remaining})
            report(f"first look at {count} candidates by {sum(effect.first_look for effect in remaining)} laws")
            shown = current if colour is None else generalised_trial(current, logs, held_out, noise)
            screened = first_look(shown, logs, remaining, noise, report, begun, fit.failed and not steps)
            looked_at = looked_at or tuple(screened)
            if colour is not None and explained_somewhere(shown, remaining, screened, logs, held_out, noise):
                colour = None
            if full or colour is not None:
                break
            found = name_next(current, baseline, screened, logs, held_out, noise, report)
            found = or_constants(found, current, baseline, screened, logs, held_out, report)
            if found is None:
                plainer = with_a_plainer_law(steps) if current.held_out.foretold > current_policy().many else None
                if plainer is None or stuck is not None:
                    break
                report(f"nothing helps beside {current.title}; {plainer[1].title} instead, and once more")
                stuck, (steps, current) = (steps, current), plainer
                continue
            found = ranked_with_fine_steps(found, logs, held_out, noise, report)
            found = ranked_between_rows(found, logs, held_out, noise, report)
            instead = rather_by_curves(steps, found, logs, held_out, noise, report) if steps else None
            if instead is not None:
                steps, current = instead
                continue
            # What was left out again may be found anew; its earlier step is no longer one.
            steps = [*(step for step in steps if step.chosen.id != found.chosen.id), found]
            current = replace(found.chosen, in_colour=None)
            if len(steps) > 1:
                current = pruned(current, baseline, logs, held_out, noise, report)
                names = _names(steps)
                steps, current = exchanged(steps, current, baseline, logs, held_out, noise, report)
                if not current.held_out.adequate:
                    new = _names(steps) != names
                    steps, current = by_laws_again(steps, current, baseline, logs, held_out, noise, report, last=new)
            left = small_after_all(current.held_out, held_out, rated)
            current = current.leaving(within_rounding(held_out, left))
            if not current.held_out.adequate:
                steps, current = rather_by_chance(steps, current, baseline, logs, held_out, noise, report)
            first = first or (list(steps), current)
            report(f"added {found.chosen.id}: held-out {current.held_out.normalised_rms:.3f} x noise")
        if stuck is not None and not current.score < stuck[1].score:
            steps, current = stuck  # nothing came of it
        stuck = None
        names = _names(steps)
        if colour is None:
            own = baseline, effects, logs, held_out, noise, report
            steps, current = named_from_the_back(steps, current, *own, confirmed)
            confirmed = set(names[:-1]) & set(_names(steps))
        if _names(steps) != names:
            current = pruned(current, baseline, logs, held_out, noise, report)
        steps, current = reconsidered(steps, current, baseline, logs, held_out, noise, report)
        if _names(steps) == names or current.held_out.adequate:
            break
        steps, current = by_laws_again(steps, current, baseline, logs, held_out, noise, report, last=True)
        if last or current.held_out.adequate or colour is not None:
            break
    if colour is None:
        steps, current = not_given_up(first, steps, current, baseline)
    if colour is None and _added(current, baseline) < most:
        steps, current = with_the_little_more(steps, current, baseline, effects, logs, held_out, noise, report)
    if colour is None and _added(current, baseline) < most:
        steps, current = by_two_formulas(steps, current, baseline, logs, held_out, noise, report)
    if colour is None and _added(current, baseline) < most:
        own = baseline, effects, logs, held_out, noise, report
        steps, current = by_a_formula_and_another(steps, current, *own)
    if current.held_out.adequate:
        steps, current = by_plainer_laws(steps, current, baseline, logs, held_out, noise, report)
        steps, current = by_formulas(steps, current, baseline, logs, held_out, noise, report)
        steps, current = pruned_in_the_end(steps, current, baseline, logs, held_out, noise, report)
    if colour is None and steps and not current.held_out.adequate:
        # What candidates still explain of it is worth none of them.
        only = colour_left(current, logs, held_out, noise)
        colour = only if only is not None and only.of_sensors else None
    if not current.held_out.adequate and colour is None:
        steps, current = _beside_rounded_inputs(steps, current, baseline, held_out)
    if not current.held_out.adequate and not (colour is not None and colour.of_sensors):
        report("looking whether noise of the inputs makes what is left")
        steps, current, colour = _beside_noise_of_inputs(steps, current, baseline, colour, logs, held_out, noise)
    if colour is None and not steps and not current.held_out.adequate:
        colour = noise_fed_back(current, logs, held_out, noise)
    if passed.adequate and not steps:
        return Search(passed, passed, None, (), looked_at)
    if colour is not None:
        report(f"what is left is noise: {colour.of_inputs.phrase if colour.of_inputs else colour.phrase}")
    return Search(state, current.held_out, current, tuple(steps), looked_at, colour)


def _beside_rounded_inputs(
    steps: list[Step], current: Trial, baseline: Trial, held_out: LogSet
) -> tuple[list[Step], Trial]:
    """The first steps after which rounding of the logged inputs makes all that is left; as they are where there are none."""
    for count, trial in enumerate([baseline, *(step.after for step in steps)]):
        left = within_input_rounding(trial.robot, held_out, trial.held_out)
        if left.inputs_rounded:
            return steps[:count], trial.leaving(left)
    return steps, current


def _beside_noise_of_inputs(
    steps: list[Step],
    current: Trial,
    baseline: Trial,
    colour: OnlyColour | None,
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
) -> tuple[list[Step], Trial, OnlyColour | None]:
    """The first steps after which noise of the inputs makes all that is left, where no name reaches the sensors' noise: what
    was added beyond them followed it. As they are where there are none."""
    for count, trial in enumerate([baseline, *(step.after for step in steps)]):
        found = inputs_left(trial, logs, held_out, noise)
        if found is not None:
            return steps[:count], trial, found
    return steps, current, colour


def _added(current: Trial, baseline: Trial) -> int:
    """How many effects the model has that the fitted one had not."""
    return len(current.robot.effects) - len(baseline.robot.effects)


def _names(steps: Sequence[Step]) -> list[str]:
    """What the steps have added, in their order."""
    return [step.chosen.id for step in steps]
