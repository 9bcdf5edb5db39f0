"""What promised as much as the best and ended far from it, refitted from where the best ended.

Where much is missing, the model's own parameters are far from what they are beside the right name, and a refit from there may
end in a minimum of its own: a pull of constant force and friction that differs by direction are one model, of which one was
found and the other lost its way. Beside the best name the parameters are right for its twins, too.
"""

from collections.abc import Sequence
from dataclasses import replace

from ...logs import LogSet
from ..refits.candidate_refits import Report, with_candidate
from ..refits.refit import FEW_STEPS, Trial, refit
from ..screening.screen import Candidate
from .denser import bare_of
from .laws import best_first

_AS_MUCH = 0.8
"""Share of the best's promise that others must have for it to be asked whether they are the same model."""
_MOST = 2
"""How many are refitted again."""


def from_the_best(
    mechanisms: Sequence[list[Trial]],
    screened: Sequence[Candidate],
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> list[list[Trial]]:
    """The mechanisms, the best first, those refitted again that promised as much and came nowhere near."""
    best = mechanisms[0][0]
    promised = {law.effect.id: law.gain for law in reversed(screened)}
    if best.effect is None or not best.fitted.adequate or best.id not in promised:
        return list(mechanisms)
    by_law = {(law.effect.id, law.effect.law): law for own in screened for law in (own, *own.laws)}
    lost = [
        own
        for own in mechanisms[1:]
        if promised.get(own[0].id, 0.0) > _AS_MUCH * promised[best.id] and not own[0].fitted.adequate
    ]
    nearer: dict[int, list[Trial]] = {}
    bare, values = bare_of(best.robot, best.effect), best.robot.parameters.numbers
    for own in lost[:_MOST]:
        law = by_law.get((own[0].id, own[0].law))
        if law is None or law.effect.repeats or best.angles:
            continue
        say(f"refitting with {law.effect.title} from where {best.effect.title} ends")
        robot = with_candidate(bare, law)
        known = {name: values[name] for name in robot.parameters.free_names if name in values}
        starts = [{**known, **{n: v for n, v in law.starts[0].items() if n not in known}}]
        # Two, so that weaker ones of it are tried, too.
        trial = refit(robot, [*starts, known], logs, held_out, noise, best.initial_states, FEW_STEPS)
        if trial.score < own[0].score:
            nearer[id(own)] = best_first([replace(trial, id=own[0].id), *own])
    if not nearer:
        return list(mechanisms)  # in the order that other questions have left
    return sorted((nearer.get(id(own), own) for own in mechanisms), key=lambda own: own[0].score)
