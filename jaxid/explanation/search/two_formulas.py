"""Two formulas of the speed in the place of one curve, such as friction that rises towards standstill and a drag.

A curve through few points follows the two together and leaves a little of both, beside which neither is worth a further name.
It is a mechanism of its own where it leaves nothing; where it does, two formulas that leave less are likelier.
"""

from collections.abc import Sequence
from dataclasses import replace

from ...effects import catalogue, laws_of
from ...effects.curve import Curve
from ...logs import LogSet
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..refits.candidate_refits import Report, all_added
from ..refits.refit import Trial, continued
from ..screening.screen import Candidate, screen
from .formulas import unfitted_without
from .laws import best_first
from .reconsider import without
from .same_curves import SPEEDS
from .steps import Step
from .telling_apart import not_told_apart, simplest_first, supersets, told_apart_from
from .worth import holds_as_well

_MOST, _FOLLOWED = 4, 2
"""Most formulas that are tried as either of the two, and how many of the first beside which a second is asked."""


def _formulas(robot: Robot) -> list[Effect]:
    """The formulas that may be added to `robot` of mechanisms whose curve is one of the speed."""
    found: list[Effect] = []
    for mechanism in catalogue(robot):
        laws = laws_of(robot, mechanism.id)
        if any(isinstance(law, Curve) and law.variable in SPEEDS for law in laws):
            found += [law.blurred for law in laws if not isinstance(law, Curve) and not law.repeats]
    return found


def _likely(trial: Trial, laws: Sequence[Effect], logs: LogSet, noise: dict[str, float]) -> list[Candidate]:
    screened = screen(trial.robot, logs, laws, noise, trial.initial_states, trial.angles) if laws else []
    every = [law for own in screened for law in (own, *own.laws) if law.gain > 0]
    return sorted(every, key=lambda law: -law.gain)[:_MOST]


def by_two_formulas(
    steps: Sequence[Step],
    current: Trial,
    base: Trial,
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> tuple[list[Step], Trial]:
    """The steps with a curve of the speed that leaves more than noise by two formulas, where these are likelier and leave less
    of logs that chose nothing; else as they were."""
    curves = [e for e in current.robot.effects if isinstance(e, Curve) and e.variable in SPEEDS]
    place = next((k for k, s in enumerate(steps) if any(e.id == s.chosen.id for e in curves)), None)
    if place is None or current.angles or current.held_out.adequate:
        return list(steps), current
    step = steps[place]
    say(f"looking whether two formulas are what {step.chosen.title} follows")
    bare = unfitted_without(step.chosen.id, current, base)
    first_look = _likely(bare, _formulas(bare.robot), logs, noise)
    firsts = sorted(all_added(bare, first_look, logs, held_out, noise, say), key=lambda trial: trial.score)
    best: tuple[Trial, Trial, list[Trial], list[Candidate]] | None = None
    for first in firsts[:_FOLLOWED]:
        likely = _likely(first, _formulas(first.robot), logs, noise)
        trials = [
            continued(trial, logs, held_out, noise) for trial in all_added(first, likely, logs, held_out, noise, say)
        ]
        pair = min(trials, key=lambda trial: trial.score, default=None)
        if pair is not None and (best is None or pair.score < best[1].score):
            best = first, pair, trials, likely
    if best is None:
        return list(steps), current
    first, pair, trials, likely = best
    less = pair.held_out.normalised_rms < current.held_out.normalised_rms
    if not (pair.score < current.score and less and told_apart_from(pair, current)):
        return list(steps), current
    by_name: dict[str, list[Trial]] = {}
    for trial in sorted(trials, key=lambda trial: trial.score):
        if holds_as_well(trial, pair):
            by_name.setdefault(trial.id, []).append(trial)
    ranked = simplest_first([best_first(laws)[0] for laws in by_name.values()])
    pair, laws = ranked[0], best_first(by_name[ranked[0].id])
    say(f"{first.title} and {pair.title} instead: held-out {pair.held_out.normalised_rms:.3f} x noise")
    alike = tuple(name for name in not_told_apart(ranked, first) if name not in supersets(ranked))
    second = Step(tuple(ranked), alike, tuple(likely), first, pair, tuple(laws))
    as_named = replace(pair, id=first.id)
    own = replace(
        step,
        trials=(as_named, *(trial for trial in step.trials if trial.id not in (first.id, pair.id))),
        equivalent=(),
        laws=(as_named,),
        laws_alike=(),
        instead=(without(first.id, pair, base, logs, held_out, noise), as_named),
    )
    return [*(own if k == place else s for k, s in enumerate(steps)), second], pair
