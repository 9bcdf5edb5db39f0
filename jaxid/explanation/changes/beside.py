"""A second change beside the first: a load and a battery, a floor and a steering lag.

Two sets of logs are seldom one change apart. Where two separate models follow them better than one change does, or something
explains more of what it leaves than chance does, every number of the robot, every cause and what promises most of the catalogue
is tried beside the one that came nearest, and what came nearest is tried anew beside that.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations

import numpy as np

from ..._distributions import chi_squared_beyond
from .candidates import Candidate, both
from .first_look import FirstLook, Score
from .joint import Colours, Joint, Pair, refit
from .trials import HeldOutLogs, Trial, each_once, price, trial_of
from .what_else import alike_beside, apart
from .whitened import Whitened

_FEW, _KEPT, _ROUNDS = 3, 4, 4
"""Steps after which the refits of two changes are compared, how many of them are refitted to the end, and of how many changes
it is asked what is beside them."""
_NEAR = 30.0
"""Chi-squared, numbers accounted for, by which a plainer pair of changes may be behind and be the way to the best."""
_IN_THE_RUNNING = 0.3
"""Share of what the best second change gains that others may lack after these steps and still be refitted to the end."""


def _beside(pair: Pair, first: Score, second: Score, joint: Joint, kept: np.ndarray, colours: Colours) -> Joint:
    """A few steps of the refit in which both have changed, the first by `kept`, from what `joint` has of the rest."""
    known = not second.own and bool(np.all(np.isfinite(second.delta)))
    start = second.delta if known else np.zeros(len(second.candidate.coordinates))
    delta, candidate = np.concatenate([kept, start]), both(first.candidate, second.candidate)
    return refit(pair, candidate, colours, joint.theta, delta, joint.states, steps=_FEW)


def changed_beside(
    pair: Pair,
    look: FirstLook,
    grounds: Sequence[tuple[Trial, Sequence[Score]]],
    colours: Colours,
    held_out: HeldOutLogs | None,
    level: float,
    report: Callable[[str], None],
) -> list[Trial]:
    """The refits in which something has changed beside one of several changes, the `grounds`, each with what is promising
    beside it: the best first, the same two once."""
    own = (_beside_this(pair, look, best, others, colours, held_out, level, report) for best, others in grounds)
    return each_once(trial for found in own for trial in found)


def _beside_this(
    pair: Pair,
    look: FirstLook,
    best: Trial,
    promising: Sequence[Score],
    colours: Colours,
    held_out: HeldOutLogs | None,
    level: float,
    report: Callable[[str], None],
) -> list[Trial]:
    """The refits in which something has changed beside the `best` change, the best first; none where nothing does so that is
    beyond chance, all that were tried accounted for. Of mechanisms of the catalogue those that are `promising` are tried."""
    own = [score for score in look.scores if score.own]
    seconds = [score for score in own if apart(score, best.score)]
    seconds += [score for score in promising if not score.own and apart(score, best.score)][:_KEPT]
    if not seconds:
        return []
    report(f"looking whether something else changed beside {best.score.candidate.title}")

    def worth(joint: Joint) -> float:
        return joint.squares + price(pair) * len(joint.delta)

    def ended(tried: Sequence[tuple[Score, Joint]]) -> list[Trial]:
        if not tried:
            return []
        least = min(joint.squares for _, joint in tried)
        near = least + _IN_THE_RUNNING * max(best.joint.squares - least, 0.0)
        running = sorted((own for own in tried if own[1].squares <= near), key=lambda own: worth(own[1]))[:_KEPT]
        trials = []
        for score, joint in running:
            end = refit(pair, joint.candidate, colours, joint.theta, joint.delta, joint.states)
            if joint.candidate is not None and joint.candidate.believable(end.delta):
                trials.append(trial_of(pair, _together(score, end), end, held_out, colours))
        return trials

    view = Whitened(look.seen, colours, best.joint.residuals)
    by_candidate = {score.candidate: score for score in look.scores}
    around, joint, kept, others = best.score, best.joint, best.joint.delta, seconds
    found, explored = list[Trial](), list[Candidate]()
    while others and len(explored) < _ROUNDS:
        explored.append(around.candidate)
        found += ended([(s, _beside(pair, around, s, joint, kept, colours)) for s in others])
        if not found:  # none of them can have changed by so much
            return []
        leader = min(found, key=lambda trial: trial.total)
        first, second = (by_candidate[part] for part in leader.score.candidate.parts)
        k = len(first.candidate.coordinates)
        if len(explored) == 1:
            gained, more = best.joint.squares - leader.joint.squares, len(leader.joint.delta) - len(best.joint.delta)
            if gained < float(chi_squared_beyond(level / len(seconds), more)):
                return []
        # What came second was found beside another: what is beside that now?
        if second.candidate in explored:
            break
        around, joint, kept = second, leader.joint, leader.joint.delta[k:]
        others = [s for s in own if s.candidate not in explored and s.candidate != first.candidate]
        others = [
            s for s in (*others, *alike_beside(look, view, first, leader.joint.delta[:k], second)) if apart(s, around)
        ]
    found += ended(_in_their_place(pair, look, view, found, by_candidate, colours))
    found += ended(_usual_ones(pair, own, found, colours))
    found += ended(_by_fewer_numbers(pair, look, found, by_candidate, colours))
    found += ended(_beside_unexplored(pair, own, explored, found, by_candidate, colours))
    found.sort(key=lambda trial: trial.total)
    for trial in found:
        report(f"refitted with {trial.score.candidate.title}: chi-squared {trial.joint.squares:.0f}")
    return found


def _in_their_place(
    pair: Pair,
    look: FirstLook,
    view: Whitened,
    found: Sequence[Trial],
    by_candidate: Mapping[Candidate, Score],
    colours: Colours,
) -> list[tuple[Score, Joint]]:
    """A few steps with what may do as well as either part of the best of those `found`: a sensor's scale, and the gain of what
    drives it. What does the same is no candidate of the robot's own alone."""
    leader = min(found, key=lambda trial: trial.total)
    first, second = (by_candidate[part] for part in leader.score.candidate.parts)
    one, other = np.split(leader.joint.delta, [len(first.candidate.coordinates)])
    tried = {frozenset(trial.score.candidate.parts) for trial in found}
    joints = []
    for keep, kept, instead, made in ((first, one, second, other), (second, other, first, one)):
        for score in alike_beside(look, view, instead, made, keep):
            if apart(score, keep) and frozenset((keep.candidate, score.candidate)) not in tried:
                joints.append((score, _beside(pair, keep, score, leader.joint, kept, colours)))
    return joints


def _by_fewer_numbers(
    pair: Pair, look: FirstLook, found: Sequence[Trial], by_candidate: Mapping[Candidate, Score], colours: Colours
) -> list[tuple[Score, Joint]]:
    """A few steps with either part of the best of those `found` by laws of fewer numbers: a curve promises more to first order,
    and is often no more than its formula."""
    leader = min(found, key=lambda trial: trial.total)
    first, second = (by_candidate[part] for part in leader.score.candidate.parts)
    one, other = np.split(leader.joint.delta, [len(first.candidate.coordinates)])
    tried = {frozenset(trial.score.candidate.parts) for trial in found}
    joints = []
    for keep, kept, curve in ((first, one, second), (second, other, first)):
        for score in look.scores:
            same = (score.candidate.id, score.candidate.side) == (curve.candidate.id, curve.candidate.side)
            fewer = len(score.candidate.coordinates) < len(curve.candidate.coordinates)
            if same and fewer and frozenset((keep.candidate, score.candidate)) not in tried:
                joints.append((score, _beside(pair, keep, score, leader.joint, kept, colours)))
    return joints


def _beside_unexplored(
    pair: Pair,
    own: Sequence[Score],
    explored: Sequence[Candidate],
    found: Sequence[Trial],
    by_candidate: Mapping[Candidate, Score],
    colours: Colours,
) -> list[tuple[Score, Joint]]:
    """A few steps with every number of the robot beside either part of the plainest of the best of those `found`, where nothing
    was asked beside that part yet: beside a friction of two numbers a radius may be one too many, and beside one the answer."""
    near = min(trial.total for trial in found) + _NEAR
    leader = min((t for t in found if t.total < near), key=lambda trial: (len(trial.joint.delta), trial.total))
    parts = [by_candidate[part] for part in leader.score.candidate.parts]
    deltas = np.split(leader.joint.delta, [len(parts[0].candidate.coordinates)])
    tried = {frozenset(trial.score.candidate.parts) for trial in found}
    joints = []
    for keep, kept in zip(parts, deltas, strict=True):
        for score in own if keep.candidate not in explored else ():
            single = len(score.candidate.coordinates) == 1 and apart(score, keep)
            if single and frozenset((keep.candidate, score.candidate)) not in tried:
                joints.append((score, _beside(pair, keep, score, leader.joint, kept, colours)))
    return joints


def _usual_ones(
    pair: Pair, own: Sequence[Score], found: Sequence[Trial], colours: Colours
) -> list[tuple[Score, Joint]]:
    """A few steps with every two of a load, a battery and a floor that have not been tried: what came first may be the same
    model by other numbers, so that neither of the two would be asked beside it."""
    leader = min(found, key=lambda trial: trial.total)
    tried = {frozenset(trial.score.candidate.parts) for trial in found}
    joints = []
    for first, second in combinations([score for score in own if score.candidate.usual], 2):
        if frozenset((first.candidate, second.candidate)) not in tried:
            candidate = both(first.candidate, second.candidate)
            joint = leader.joint
            joints.append((second, refit(pair, candidate, colours, joint.theta, None, joint.states, steps=_FEW)))
    return joints


def _together(score: Score, joint: Joint) -> Score:
    """The score as that of both, whose names stand in the candidate."""
    assert joint.candidate is not None
    return Score(joint.candidate, score.gain, score.p_value, joint.delta, score.errors, score.directions, True, ())


__all__ = ["changed_beside"]
