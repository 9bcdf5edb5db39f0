"""The first look: what each candidate would explain of the difference between the two sets, to first order.

Both sets are simulated at the first fit's numbers. What the shared parameters and the initial states can take up is projected
off, and the score (Lagrange-multiplier) test of each candidate's coordinates remains (Rao, Proceedings of the Cambridge
Philosophical Society 44, 1948). All is whitened for noise of the colour that the best candidates leave together, and
the scores' variance is at least what blocks of time show.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ..._distributions import chi_squared_tail
from ...robots.robot import Robot
from .candidates import Candidate, Side
from .joint import SIDES, Colours, Pair, stacked, white
from .moved import Changes, Linear, all_that_may_move
from .noise_left import MOST, NoiseLeft, noise_left
from .whitened import Whitened, answer, statistic, wider

Array = NDArray[np.float64]
_FAR_OFF = 3.0
"""Times the noise from which what the best candidate leaves is no noise of any colour: whitened by itself, the difference would
pass for noise."""
UNSEEN = 1e-6
"""Change of all samples together, in units of the noise, for a coordinate's magnitude, below which nothing shows it."""
_SAME = 1e-2
"""Share of a change's length that may be left of it where another makes it, too."""


@dataclass(frozen=True)
class Score:
    """What the first look says of a candidate.

    `gain` is the drop of the sum of squares with `delta` [k], its probability by chance `p_value`; `errors` [k] are the
    standard errors that each coordinate alone would have; `directions` [rows, k] are the whitened changes of both sides, what
    the shared parameters take up taken off, in units of a coordinate's magnitude. `same` are titles of candidates that are the
    same model by another name; `own` is whether it is no mechanism of the catalogue; `in_white` is the gain if all noise were
    white.
    """

    candidate: Candidate
    gain: float
    p_value: float
    delta: Float[np.ndarray, " k"]
    errors: Float[np.ndarray, " k"]
    directions: Float[np.ndarray, "R k"] = field(repr=False)
    own: bool
    same: tuple[str, ...] = ()
    in_white: float = 0.0

    @property
    def worth(self) -> float:
        """The gain less what its coordinates cost (Schwarz's criterion)."""
        return self.gain - len(self.delta) * float(np.log(len(self.directions)))


@dataclass(frozen=True)
class FirstLook:
    """The `scores`, the most worth first, one of each mechanism and of candidates that do the same; the `colours` of what the
    best ones leave together; how many candidates and shapes were `tried`; what no log shows (`unseen`, titles); shared
    parameters `theta` to start from; all that was `seen` to move, and its directions `in_white` noise; whether the difference
    is `far` beyond the noise, so that white noise is taken; how many changes at `most` are no noise."""

    scores: tuple[Score, ...]
    colours: Colours
    tried: int
    unseen: tuple[str, ...]
    theta: Float[np.ndarray, " n"]
    seen: Linear = field(repr=False)
    in_white: tuple[Array, ...] = field(repr=False)
    far: bool = False
    most: int = MOST

    def changes_of(self, candidate: Candidate | None) -> list[Changes]:
        """To first order, what a candidate changes, or what its parts do."""
        parts = (candidate.parts or (candidate,)) if candidate is not None else ()
        return [change for change in self.seen.changes if change.candidate in parts]


def first_look(
    robot: Robot,
    pair: Pair,
    known: Mapping[Side, Mapping[str, Mapping[str, float]]],
    report: Callable[[str], None] = lambda message: None,
    most: int = MOST,
) -> FirstLook:
    """Score everything that may have changed of `robot`, the first fit's. `known` are the estimated initial states of each
    side's logs by name; `report` is told how far the simulations are. So many changes at `most` are no noise."""
    seen = all_that_may_move(robot, pair, known, report)
    plain = Whitened(seen, white(pair))
    best, worth, in_white = plain.left, -np.inf, []
    directions = tuple(plain.directions(change) for change in seen.changes)
    for change, D in zip(seen.changes, directions, strict=True):
        delta, gain = answer(D, plain.left, change.positive)
        in_white.append(gain)
        if gain - len(delta) * np.log(len(D)) > worth:
            best, worth = plain.left + D @ delta, gain - len(delta) * np.log(len(D))
    left = plain.shaped(best)
    far = float(np.sqrt(np.mean(np.square(np.concatenate([left[s][pair.sides[s].there] for s in SIDES]))))) > _FAR_OFF
    noise = NoiseLeft(white(pair)) if far else noise_left(seen, plain, directions, most=most)
    view = Whitened(seen, noise.colours)
    every = [view.directions(change) for change in seen.changes]
    answers = [answer(D, view.left, change.positive) for change, D in zip(seen.changes, every, strict=True)]
    worths = [gain - len(delta) * np.log(len(view.left)) for delta, gain in answers]
    k = int(np.argmax(worths))
    remains = noise.without(view) if noise.taken else view.left + every[k] @ answers[k][0]
    blocks, logs = view.blocks(remains), view.logs
    scores, unseen = [], []
    for change, D, (delta, gain), as_white in zip(seen.changes, every, answers, in_white, strict=True):
        size = np.linalg.norm(D, axis=0)
        shown = size > UNSEEN
        if not shown.any():
            unseen.append(change.candidate.title)
            continue
        broad = wider(D, remains, blocks, logs, view.basis.shape[1])
        found, freedom = statistic(D[:, shown], view.left, remains, blocks, logs, view.basis.shape[1])
        found = found if gain > 0 else 0.0
        p = float(chi_squared_tail(found, max(freedom, 1)))
        with np.errstate(divide="ignore"):
            errors = np.abs(change.sizes) * broad / size
        start = np.where(np.isfinite(change.sizes), delta * np.nan_to_num(change.sizes), change.candidate.start or 0.0)
        own = change.candidate in pair.own
        scores.append(Score(change.candidate, found, p, start, errors, D, own, in_white=as_white))
    theta = np.array([pair.robot.parameters[n].value for n in pair.free])
    step = -np.linalg.lstsq(stacked(view.columns), stacked(view.residual) + every[k] @ answers[k][0], rcond=1e-8)[0]
    shown = {score.candidate.title for score in scores}  # by another of its laws, say
    scores = _without_doubles(scores)
    return FirstLook(
        tuple(_one_of_each(scores)),
        noise.colours,
        len(scores),
        tuple(title for title in dict.fromkeys(unseen) if title not in shown),
        theta + step * pair.sizes(),
        seen,
        directions,
        far,
        most,
    )


def _one_of_each(scores: Sequence[Score]) -> list[Score]:
    """The best of each mechanism by its worth, and the best law of fewer numbers than a curve that comes first: to first order
    alone the curve may promise more."""
    fewest: dict[tuple[str, str], int] = {}
    kept: list[Score] = []
    for score in sorted(scores, key=lambda s: -s.worth):
        key, count = (score.candidate.id, score.candidate.side), len(score.delta)
        if key not in fewest or count < fewest[key]:
            fewest[key] = count
            kept.append(score)
    return kept


def _without_doubles(scores: Sequence[Score]) -> list[Score]:
    """Of the robot's own candidates of one coordinate that make the same change the one that was named first, which keeps the
    others' names."""
    kept: list[Score] = []
    for score in scores:
        own = score.directions[:, 0] / max(float(np.linalg.norm(score.directions[:, 0])), 1e-300)
        for i, other in enumerate(kept):
            if len(score.delta) != 1 or len(other.delta) != 1 or not (score.own and other.own):
                continue
            if abs(float(own @ other.directions[:, 0])) > (1.0 - _SAME**2) * float(
                np.linalg.norm(other.directions[:, 0])
            ):
                kept[i] = replace(other, same=(*other.same, score.candidate.title))
                break
        else:
            kept.append(score)
    return kept
