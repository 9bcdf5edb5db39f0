"""What else two sets of logs may differ by, to first order: what explains more of what is left, what would do as well as
something that was found, and what may have changed as well without being seen."""

from dataclasses import replace

import numpy as np

from ..._distributions import chi_squared_tail
from .candidates import is_only_later
from .first_look import UNSEEN, FirstLook, Score
from .joint import Colours
from .noise_left import basis_of
from .trials import Trial
from .whitened import Whitened, answer, statistic

_MOST = 4
"""Mechanisms that are tried in the place of one."""
_DIFFERENT, _WITHIN = 0.1, 0.02
"""Share of a change, squared, that another must not make for the two to be different, and share of one of which nothing is its
own."""


def apart(one: Score, other: Score) -> bool:
    """Whether two candidates move different numbers of the same side, and not by two laws of one mechanism."""
    a, b = one.candidate, other.candidate
    named = {c.name for c in a.coordinates} & {c.name for c in b.coordinates}
    return a.side == b.side and a.id != b.id and not named


def alike_beside(look: FirstLook, view: Whitened, score: Score, delta: np.ndarray, keep: Score) -> list[Score]:
    """Mechanisms of the catalogue that, to first order, may make beside `keep` what a candidate of this size makes, or that
    make all come later as it does, the nearest first."""
    of = {change.candidate: change for change in look.seen.changes}
    own, basis = of[score.candidate], basis_of(view, look.changes_of(keep.candidate))

    def beside(rows: np.ndarray) -> np.ndarray:
        return rows - basis @ (basis.T @ rows)

    makes = beside(view.directions(own) @ np.nan_to_num(delta / own.sizes))
    if not makes.any():
        return []
    found: list[tuple[float, Score]] = []
    for other in look.scores:
        if other.own or not apart(other, score):
            continue
        onto = np.linalg.qr(beside(view.directions(of[other.candidate])))[0]
        left = float(np.sum((makes - onto @ (onto.T @ makes)) ** 2) / max(float(makes @ makes), 1e-300))
        if left < _DIFFERENT or (is_only_later(other.candidate) and is_only_later(score.candidate)):
            found.append((left, other))
    return [other for _, other in sorted(found, key=lambda own: own[0])][:_MOST]


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
    others = [c for c in look.seen.changes if c.candidate in scores and apart(scores[c.candidate], best.score)]
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
