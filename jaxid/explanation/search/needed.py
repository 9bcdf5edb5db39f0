"""Which of the added effects the final fit is sure of, and that fit without those that it is not sure of and does without."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from ...estimate.result import Estimate, Fit
from ...logs import LogSet
from ...parameters import ParameterError
from ...robots.effect import Effect
from ..left.heldout import HeldOut
from ..named_effect import differs_from_nothing, effect_parameters
from ..refits.prescribed_angles import predicted
from ..refits.refit import Trial
from .denser import bare_of
from .steps import Search, Step
from .telling_apart import clearly_better
from .worth import likelier

_NO_SLOPE = 1e3
"""Standard errors, in sizes of a parameter, that only a slope which is none but for rounding leaves."""


def sure_of(effect: Effect, step: Step, baseline: Fit, final: Fit) -> bool:
    """Whether the data excludes that there is no such effect."""
    own = effect_parameters(effect.id, effect.frees(final.robot), final.parameters)
    return differs_from_nothing(effect, baseline, final) or _between_samples(effect, own, step)


def _between_samples(effect: Effect, own: Mapping[str, Estimate], step: Step) -> bool:
    """Whether the effect's edge lies where no sample does, such as between two levels of a command or, of a delay, between two
    samples, so that its parameters have no slope and no errors: that it is there, the likelihood says."""
    flat = all(e.std_error > _NO_SLOPE * abs(e.value) for e in own.values() if e.status != "fixed")
    apart = clearly_better(step.after.fitted, step.before.fitted)
    edge = effect.blurred != effect.sharp or effect.only_later
    return flat and edge and apart and likelier(step.before, step.after, 1)


def unsure_of(found: Search, baseline: Fit, final: Fit) -> list[str]:
    """The ids of the added effects that the final fit is not sure of, none where it is not sure of any."""
    steps = {step.chosen.id: step for step in found.steps}
    added = [effect for effect in final.robot.effects if effect.id in steps]
    unsure = [effect.id for effect in added if not sure_of(effect, steps[effect.id], baseline, final)]
    return unsure if len(unsure) < len(added) else []


def only_needed(
    found: Search,
    final: Fit,
    after: HeldOut,
    baseline: Fit,
    held_out: LogSet,
    in_full: Callable[[Trial], Fit],
    say: Callable[[str], None],
) -> tuple[Search, Fit, HeldOut]:
    """What was found, its fit in full and its state on the held-out logs; without effects that may as well be none where all is
    explained without them, or as much: what one effect's first guess had left, another may have been added for. `baseline` is
    the fit that lacks them all."""
    steps = {step.chosen.id: step for step in found.steps}
    if len(steps) == 1:
        # The model without it is the one that it was added to.
        ((identifier, step),) = steps.items()
        needed = clearly_better(after, step.before.held_out) and clearly_better(step.after.fitted, step.before.fitted)
        found = replace(found, needed=(identifier,)) if needed else found
    for identifier in unsure_of(found, baseline, final):
        if found.final is None:
            break
        say(f"fitting again without {identifier}, which may as well be none")
        effect = next(effect for effect in final.robot.effects if effect.id == identifier)
        # From the final values, at which the simulation finds its way without prescribed angles.
        lean = replace(found.final, robot=bare_of(final.robot, effect), angles=None)
        try:
            fit = in_full(lean)
        except ParameterError:  # without it, these values lead nowhere: it is needed
            continue
        state = predicted(fit.robot, held_out, after.noise)
        enough = state.adequate if after.adequate else not clearly_better(after, state)
        step = steps[identifier]
        if clearly_better(after, state) and clearly_better(step.after.fitted, step.before.fitted):
            found = replace(found, needed=(*found.needed, identifier))
        if enough and not fit.failed:
            say(f"{identifier} is not needed")
            rest = tuple(step for step in found.steps if step.chosen.id != identifier)
            found = replace(found, final=lean, steps=rest, needed=tuple(i for i in found.needed if i != identifier))
            final, after = fit, state
    return found, final, after
