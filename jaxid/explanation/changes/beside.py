"""A second change beside the first: a load and a battery, a floor and a steering lag.

Two sets of logs are seldom one change apart. Where two separate models follow them better than one change does, or something
explains more of what it leaves than chance does, every number of the robot, every cause and what promises most of the catalogue
is tried beside the one that came nearest, and what came nearest is tried anew beside that.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..._distributions import chi_squared_beyond, chi_squared_tail
from .candidates import Candidate, both, is_only_later
from .first_look import UNSEEN, FirstLook, Score
from .joint import Colours, Joint, Pair, refit
from .noise_left import basis_of
from .trials import HeldOutLogs, Trial, price, trial_of
from .whitened import Whitened, answer, statistic

_FEW, _KEPT, _ROUNDS = 3, 4, 4
"""Steps after which the refits of two changes are compared, how many of them are refitted to the end, and of how many changes
it is asked what is beside them."""
_IN_THE_RUNNING = 0.3
"""Share of what the best second change gains that others may lack after these steps and still be refitted to the end."""

_DIFFERENT, _WITHIN = 0.1, 0.02
"""Share of a change, squared, that another must not make for the two to be different, and share of one of which nothing is its
own."""


def _apart(one: Score, other: Score) -> bool:
    """Whether two candidates move different numbers of the same side, and not by two laws of one mechanism."""
    a, b = one.candidate, other.candidate
    named = {c.name for c in a.coordinates} & {c.name for c in b.coordinates}
    return a.side == b.side and a.id != b.id and not named


def _beside(pair: Pair, first: Score, second: Score, joint: Joint, kept: np.ndarray, colours: Colours) -> Joint:
    """A few steps of the refit in which both have changed, the first by `kept`, from what `joint` has of the rest."""
    start = (
        second.delta
        if not second.own and np.all(np.isfinite(second.delta))
        else np.zeros(len(second.candidate.coordinates))
    )
    delta = np.concatenate([kept, start])
    candidate = both(first.candidate, second.candidate)
    return refit(pair, candidate, colours, joint.theta, delta, joint.states, steps=_FEW)


def _alike(look: FirstLook, view: Whitened, score: Score, delta: np.ndarray, keep: Score) -> list[Score]:
    """Mechanisms of the catalogue that, to first order, may make beside `keep` what a candidate of this size makes, or that
    make all come later as it does, the nearest first."""
    of = {change.candidate: change for change in look.seen.changes}
    own, basis = of[score.candidate], basis_of(view, look.changes_of(keep.candidate))

    def beside(rows: np.ndarray) -> np.ndarray:
        return rows - basis @ (basis.T @ rows)

    makes = beside(view.directions(own) @ np.nan_to_num(delta / own.sizes))
    found: list[tuple[float, Score]] = []
    for other in look.scores:
        if other.own or not _apart(other, score):
            continue
        onto = np.linalg.qr(beside(view.directions(of[other.candidate])))[0]
        left = float(np.sum((makes - onto @ (onto.T @ makes)) ** 2) / max(float(makes @ makes), 1e-300))
        if left < _DIFFERENT or (is_only_later(other.candidate) and is_only_later(score.candidate)):
            found.append((left, other))
    return [other for _, other in sorted(found, key=lambda own: own[0])][:_KEPT]


def as_well(look: FirstLook, best: Trial, colours: Colours) -> list[str]:
    """Titles of what may have changed as well where two changes are named: what it does is what these do together in other
    sizes, and nothing that either does by itself."""
    parts = best.score.candidate.parts
    if len(parts) < 2:
        return []
    view = Whitened(look.seen, colours, best.joint.residuals)
    changes = [look.changes_of(part) for part in parts]
    alone, together = [basis_of(view, own) for own in changes], basis_of(view, [c for own in changes for c in own])
    found = []
    for score in look.scores:
        if not score.own or len(score.delta) != 1 or score.candidate in parts:
            continue
        D = view.directions(look.changes_of(score.candidate)[0])[:, 0]

        def outside(basis: np.ndarray, D: np.ndarray = D) -> float:
            return float(np.linalg.norm(D - basis @ (basis.T @ D)) / max(float(np.linalg.norm(D)), 1e-300))

        if outside(together) < _WITHIN and all(outside(own) > 10.0 * _WITHIN for own in alone):
            found.append(score.candidate.title)
    return found


def promising_beside(look: FirstLook, best: Trial, colours: Colours, level: float) -> list[Score]:
    """What would explain more of what the `best` change leaves than chance lets any of so many, to first order, the most
    worth first."""
    view = Whitened(look.seen, colours, best.joint.residuals)
    basis = basis_of(view, look.changes_of(best.joint.candidate))
    left = view.left - basis @ (basis.T @ view.left)
    scores = {score.candidate: score for score in look.scores}
    others = [c for c in look.seen.changes if c.candidate in scores and _apart(scores[c.candidate], best.score)]
    every = []
    for change in others:
        D = view.directions(change)
        every.append(D - basis @ (basis.T @ D))
    answers = [answer(D, left, change.positive) for change, D in zip(others, every, strict=True)]
    if not answers:
        return []
    k = max(range(len(answers)), key=lambda i: answers[i][1] - every[i].shape[1] * np.log(len(left)))
    remains = left + every[k] @ answers[k][0]
    blocks, logs, free = view.blocks(remains), view.logs, view.basis.shape[1] + basis.shape[1]
    found = []
    for change, D, (delta, gain) in zip(others, every, answers, strict=True):
        shown = np.linalg.norm(D, axis=0) > UNSEEN
        if gain <= 0 or not shown.any():
            continue
        drop, freedom = statistic(D[:, shown], left, remains, blocks, logs, free)
        p = float(chi_squared_tail(drop, max(freedom, 1)))
        if p * len(others) < level:
            old = scores[change.candidate]
            start = np.where(np.isfinite(change.sizes), delta * np.nan_to_num(change.sizes), old.delta)
            found.append(replace(old, gain=drop, p_value=p, delta=start))
    return sorted(found, key=lambda score: -score.worth)


def changed_beside(
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
    seconds = [score for score in own if _apart(score, best.score)]
    seconds += [score for score in promising if not score.own and _apart(score, best.score)][:_KEPT]
    if not seconds:
        return []
    report(f"looking whether something else changed beside {best.score.candidate.title}")

    def worth(joint: Joint) -> float:
        return joint.squares + price(pair) * len(joint.delta)

    def ended(tried: Sequence[tuple[Score, Joint]]) -> list[Trial]:
        least = min(joint.squares for _, joint in tried)
        near = least + _IN_THE_RUNNING * max(best.joint.squares - least, 0.0)
        running = sorted((own for own in tried if own[1].squares <= near), key=lambda own: worth(own[1]))[:_KEPT]
        trials = []
        for score, joint in running:
            end = refit(pair, joint.candidate, colours, joint.theta, joint.delta, joint.states)
            trials.append(trial_of(pair, _together(score, end), end, held_out, colours))
        return trials

    view = Whitened(look.seen, colours, best.joint.residuals)
    by_candidate = {score.candidate: score for score in look.scores}
    around, joint, kept, others = best.score, best.joint, best.joint.delta, seconds
    found, explored = list[Trial](), list[Candidate]()
    while others and len(explored) < _ROUNDS:
        explored.append(around.candidate)
        found += ended([(s, _beside(pair, around, s, joint, kept, colours)) for s in others])
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
        others = [s for s in (*others, *_alike(look, view, first, leader.joint.delta[:k], second)) if _apart(s, around)]
    # What does the same is no candidate of the robot's own alone: a sensor's scale, and the gain of what drives it.
    leader = min(found, key=lambda trial: trial.total)
    first, second = (by_candidate[part] for part in leader.score.candidate.parts)
    k, tried = len(first.candidate.coordinates), {frozenset(t.score.candidate.parts) for t in found}
    for keep, kept, other, made in (
        (first, leader.joint.delta[:k], second, leader.joint.delta[k:]),
        (second, leader.joint.delta[k:], first, leader.joint.delta[:k]),
    ):
        instead = [s for s in _alike(look, view, other, made, keep) if _apart(s, keep)]
        instead = [s for s in instead if frozenset((keep.candidate, s.candidate)) not in tried]
        if instead:
            found += ended([(s, _beside(pair, keep, s, leader.joint, kept, colours)) for s in instead])
    found.sort(key=lambda trial: trial.total)
    for trial in found:
        report(f"refitted with {trial.score.candidate.title}: chi-squared {trial.joint.squares:.0f}")
    return found


def _together(score: Score, joint: Joint) -> Score:
    """The score as that of both, whose names stand in the candidate."""
    assert joint.candidate is not None
    return Score(joint.candidate, score.gain, score.p_value, joint.delta, score.errors, score.directions, True, ())


__all__ = ["changed_beside"]
