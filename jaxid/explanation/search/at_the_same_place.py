"""Effects of which the finished model is not sure, beside formulas that act at the same place of the signal path.

A name that came first while others were missing may stand, with numbers that no log tells, for one that was out of reach then:
friction that falls off at no speed any more, of one axis, is an axis that has more of it.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from ...effects.curve import SHAPE
from ...logs import LogSet
from ...parameters import ParameterError
from ...robots.effect import Effect
from ...robots.robot import Robot
from ...robots.signal_path import STAGES, overrides
from ..left.heldout import held_out_state
from ..refits.candidate_refits import Report, all_added
from ..refits.refit import Prediction, Trial, continued
from ..screening.screen import screen
from .from_the_back import not_present
from .reconsider import bare_of_the_end, with_trials, without
from .steps import Search, Step
from .worth import holds_as_well

_PLACES = (*STAGES, "command", "measure")


def _places(effect: Effect) -> set[str]:
    return {stage for stage in _PLACES if overrides(type(effect), stage)}


def by_others_at_the_same_place(
    found: Search, unsure: Collection[str], effects: Sequence[Effect], logs: LogSet, held_out: LogSet, say: Report
) -> Search:
    """What was found, with each of the names that it is not sure of (`unsure`) replaced by a formula that acts where it does
    and is the likelier model beside the rest. `effects` are candidates beside the catalogue's."""
    steps = []
    for step in found.steps:
        if step.chosen.id in unsure and found.final is not None and not found.final.angles:
            step, final = _by_others(step, found.final, found.steps[0].before, effects, logs, held_out, say)
            found = replace(found, final=final, after=final.held_out)
        steps.append(step)
    return replace(found, steps=tuple(steps))


def _as_it_stands(robot: Robot, like: Trial, logs: LogSet, held_out: LogSet, noise: Mapping[str, float]) -> Trial:
    """A model that is not refitted, with the initial states of another."""
    left = held_out_state(robot, logs, noise)
    return Trial(
        id=robot.effects[-1].id if robot.effects else "",
        robot=robot,
        squares=left.squares,
        free=len(robot.parameters.free_names),
        fitted=left,
        predicts=Prediction(robot, held_out, noise),
        initial_states=like.initial_states,
    )


def _by_others(
    step: Step, final: Trial, base: Trial, effects: Sequence[Effect], logs: LogSet, held_out: LogSet, say: Report
) -> tuple[Step, Trial]:
    noise = base.held_out.noise
    own = next((effect for effect in final.robot.effects if effect.id == step.chosen.id), None)
    if own is None:
        return step, final
    say(f"refitting what acts where {own.title} does, instead of it")
    # The others keep their numbers: refitted without it, they would bend to follow what it does.
    try:
        bare = _as_it_stands(bare_of_the_end(own.id, final, base), final, logs, held_out, noise)
    except ParameterError:  # without it, these numbers lead nowhere
        return step, final
    laws = [law for law in not_present(bare.robot, effects, logs) if law.id != own.id and law.law != SHAPE]
    laws = [law for law in laws if law.where == own.where and _places(law) & _places(own)]
    screened = screen(bare.robot, logs, laws, noise, bare.initial_states)
    promising = [law for candidate in screened for law in (candidate, *candidate.laws) if law.gain > 0]
    trials = all_added(bare, promising, logs, held_out, noise, say)
    trials = [t for t in trials if t.score < bare.score and holds_as_well(t, final)]
    best = min(trials, key=lambda trial: trial.score, default=final)
    best = final if best is final else continued(best, logs, held_out, noise)
    if not best.score < final.score:
        return step, final
    say(f"{best.title} instead of {own.title}: held-out {best.held_out.normalised_rms:.3f} x noise")
    instead = (without(own.id, final, base, logs, held_out, noise), best)
    step = with_trials(step, [best, replace(final, id=own.id)])
    # That what its numbers do not tell can be so small, or so far, that it is the same is no evidence for it.
    equivalent = tuple(name for name in step.equivalent if name != own.id)
    return replace(step, equivalent=equivalent, instead=instead), best
