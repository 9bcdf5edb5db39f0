"""The candidates refitted to both sets of logs and ranked: the best one, and those that the logs cannot tell from it."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...estimate.result import NORMAL_95
from ...logs import LogSet
from ..search.telling_apart import vuong
from .candidates import Candidate, Side, is_only_later
from .first_look import FirstLook, Score
from .joint import SIDES, Colours, Joint, Pair, inside, numbers_on, refit, weighed, white, with_candidate
from .judged import predicted
from .noise_left import NoiseLeft, likelihood_cost, noise_left
from .whitened import Whitened

_MOST, _ALWAYS, _FEW, _LIKELY = 8, 3, 3, 4
_PROMISING = 0.3
"""Share of the best candidate's promise below which mechanisms of the catalogue are not refitted, but for the first three."""
_MORE = 8
"""Steps of a refit where the difference is far beyond the noise."""
_IN_THE_RUNNING, _FAR = 0.3, 100.0
"""Candidates that come so near to the best one's gain in a few steps are refitted to the end."""
_NEAR = 16.0
"""Chi-squared by which two candidates must differ to be told apart, and standard errors of the difference."""
_APART = 2.0
NEARLY = 0.05
"""Share of the difference by which candidates beside models that are poor themselves must differ."""
LEFT = 0.03
"""Share of the difference that a change may leave, significant or not: how far the models themselves are from nature."""


@dataclass(frozen=True)
class HeldOutLogs:
    """Held-out logs of both sides."""

    logs: dict[Side, LogSet]

    def residuals(self, pair: Pair, joint: Joint, colours: Colours) -> list[np.ndarray]:
        """Whitened residuals of a refit's prediction."""
        found: list[np.ndarray] = []
        robot = with_candidate(pair.robot, joint.candidate)
        for side, logs in self.logs.items():
            numbers = numbers_on(side, robot, pair.free, joint.candidate, joint.theta, joint.delta)
            names = logs.channels.measured
            sigma = dict(zip(names, map(float, pair.sides[side].sigma), strict=True))
            found += predicted(robot.with_values(**numbers), logs, sigma, dict(zip(names, colours[side], strict=True)))
        return found


@dataclass(frozen=True)
class Trial:
    """A refitted candidate: its first score, its refit, the `total` of its squares and its price, whitened residuals to
    compare."""

    score: Score
    joint: Joint
    total: float
    compared: list[np.ndarray]


def _whitened(pair: Pair, joint: Joint, colours: Colours) -> list[np.ndarray]:
    """Whitened residuals [T, ny] of every log."""
    return [own for side in SIDES for own in pair.sides[side].whiten(joint.residuals[side], colours[side])]


def _shortlist(look: FirstLook) -> list[Score]:
    """The candidates worth a refit: all of the robot's own, since large changes are not what they promise to first order, and
    the mechanisms that promise most, also if all that differs were taken for change and none of it for slow noise."""
    others = [score for score in look.scores if not score.own and score.gain > 0.0]
    least = _PROMISING * max((score.gain for score in look.scores), default=0.0)
    kept = [s for i, s in enumerate(others[:_MOST]) if i < _ALWAYS or s.gain > least]
    kept += [s for s in sorted(others, key=lambda s: -s.in_white)[:_ALWAYS] if s not in kept]
    return [*(score for score in look.scores if score.own and not score.candidate.beside), *kept]


def price(pair: Pair) -> float:
    """What a number more must gain (Schwarz's criterion)."""
    return float(np.log(sum(int(own.there.sum()) for own in pair.sides.values())))


def trial_of(pair: Pair, score: Score, joint: Joint, held_out: HeldOutLogs | None, colours: Colours) -> Trial:
    """The refit of a candidate, with what it leaves of the logs by which candidates are compared."""
    compared = held_out.residuals(pair, joint, colours) if held_out is not None else _whitened(pair, joint, colours)
    total = joint.squares + price(pair) * len(joint.delta)
    total += sum(float(np.sum(r**2)) for r in compared) if held_out is not None else 0.0
    return Trial(score, joint, total, compared)


def refitted(
    pair: Pair, look: FirstLook, null: Joint, held_out: HeldOutLogs | None, report: Callable[[str], None]
) -> tuple[list[Trial], Trial, Joint, Colours]:
    """The shortlist refitted, the best first; the one that is likeliest with what else may have changed; the model without any
    change; the colours of the noise that is then left."""
    rows = price(pair)

    def left_by(joint: Joint) -> NoiseLeft:
        view = Whitened(look.seen, white(pair), joint.residuals)
        return noise_left(look.seen, view, look.in_white, look.changes_of(joint.candidate), look.most)

    joints: list[tuple[Score, Joint]] = []
    for score in _shortlist(look):
        start = score.delta if np.all(np.isfinite(score.delta)) else None
        # What large changes promise to first order may lead away from them.
        starts = (start, None) if look.far and start is not None else (start,)
        steps = _MORE if look.far else _FEW
        tried = [refit(pair, score.candidate, look.colours, look.theta, own, steps=steps) for own in starts]
        joints.append((score, min(tried, key=lambda joint: joint.squares)))
    # Each with noise of its own colour (that of a worse one would pass for what the better one explains), and those that come
    # first with what else makes it likelier: several may differ at once.
    joints.sort(key=lambda own: likelihood_cost(pair, own[1].residuals)[0] + rows * len(own[1].delta))
    first = joints[0][1]
    if len(left_by(first).taken) > len(look.changes_of(first.candidate)):
        likely = [*joints[:_LIKELY], *[own for own in joints[_LIKELY:] if own[0].own][:_LIKELY]]
        _, first = min(likely, key=lambda own: left_by(own[1]).cost)
    first = refit(pair, first.candidate, look.colours, first.theta, first.delta, first.states)
    colours = left_by(first).colours
    nothing = weighed(pair, null, colours)
    reached = weighed(pair, first, colours)
    near = reached + max(_IN_THE_RUNNING * (nothing - reached), _FAR)

    def again(joint: Joint) -> Joint:
        squares = weighed(pair, joint, colours)
        if squares < near:
            return refit(pair, joint.candidate, colours, joint.theta, joint.delta, joint.states)
        return replace(joint, squares=squares)

    trials = [trial_of(pair, score, again(old), held_out, colours) for score, old in joints]
    trials = [trial for trial in trials if trial.score.candidate.believable(trial.joint.delta)]
    trials.sort(key=lambda trial: trial.total)
    # Of a mechanism's laws the best.
    first_of = {(t.score.candidate.id, t.score.candidate.side): t for t in reversed(trials)}
    trials = [t for t in trials if first_of[t.score.candidate.id, t.score.candidate.side] is t]
    likeliest = next((t for t in trials if t.score.candidate == first.candidate), trials[0])
    for trial in trials:
        report(f"refitted with {trial.score.candidate.title}: chi-squared {trial.joint.squares:.0f}")
    return trials, likeliest, refit(pair, None, colours, null.theta, None, null.states), colours


def each_once(trials: Iterable[Trial]) -> list[Trial]:
    """Trials of two changes, the best first; of the same two, tried on several grounds, the best."""
    best: dict[frozenset[Candidate], Trial] = {}
    for trial in sorted(trials, key=lambda trial: trial.total):
        best.setdefault(frozenset(trial.score.candidate.parts), trial)
    return [*best.values()]


def simplest_first(trials: list[Trial], null: Joint, poor: bool) -> list[Trial]:
    """The best and those that the data cannot tell from it, the simplest first, of equally simple ones the usual; none that
    says the same with more numbers, but for what one does `as_well_as`. Of `poor` models, which lack what both sets have,
    those that explain nearly as much of what `null` leaves are as good."""
    best = trials[0]
    nearly = NEARLY * (null.squares - best.joint.squares) if poor else 0.0
    near = [best]
    for trial in trials[1:]:
        behind = trial.total - best.total
        # Of what is the same but for rounding a next to nothing may be many of its own standard errors.
        alike = behind < _NEAR and (vuong(best.compared, trial.compared) < _APART or behind < _APART**2)
        if alike or behind < nearly:
            near.append(trial)
    near.sort(key=lambda trial: (len(trial.joint.delta), not trial.score.candidate.is_usual, trial.total))
    kept: list[Trial] = []
    for trial in near:
        simpler = (own for own in kept if len(own.joint.delta) < len(trial.joint.delta))
        simpler = (own for own in simpler if own.score.candidate.stands_for != trial.score.candidate.ids)
        simpler = (own for own in simpler if not _usual_beside(own.score.candidate, trial.score.candidate))
        if not any(_says_the_same(own, trial) for own in simpler):
            kept.append(trial)
    return kept


def _usual_beside(unusual: Candidate, usual: Candidate) -> bool:
    """Whether the second is a usual change of other parameters of the robot than the first, which is none."""
    apart = unusual.own and usual.own and not set(unusual.own) & set(usual.own)
    return bool(apart) and usual.is_usual and not unusual.is_usual


def with_a_number_more(best: Trial, others: Sequence[Trial]) -> list[Trial]:
    """Those of the `others` that say the same as the best two changes by another one in the place of either, which has a number
    more."""
    mine, said = {part.id for part in best.score.candidate.parts}, list[Trial]()
    for trial in others:
        more = len(trial.joint.delta) - len(best.joint.delta)
        new = {part.id for part in trial.score.candidate.parts} - mine
        if new and more == 1 and _says_the_same(best, trial):
            said.append(trial)
    return said


def unlikely(best: Trial, pair: Pair) -> list[str]:
    """Why effects of the best candidate are hardly what came or went, those of their numbers left out that may be none."""
    candidate, delta = best.score.candidate, best.joint.delta
    errors = np.sqrt(np.maximum(np.diag(best.joint.covariance), 0.0))
    shown = np.where(np.abs(delta) > NORMAL_95 * errors, delta, 0.0)
    numbers = candidate.move(pair.robot.parameters.numbers, shown)
    robot = with_candidate(pair.robot, candidate)
    robot = robot.with_values(**inside(robot, numbers))
    return [why for effect in candidate.effects if (why := effect.doubt_of_change(robot))]


def only_later(best: Trial, others: list[Trial], null: Joint) -> list[Trial]:
    """Of the `others` those that make the same motion later, as late commands do as well as late sensors, where the best does
    and they leave little of the difference: between two samples each is interpolated in its own way."""
    mine = _later_and_else(best)
    if mine is None:
        return []
    later = [t for t in (best, *others) if _later_and_else(t) == mine]
    left = best.joint.squares + LEFT * (null.squares - best.joint.squares)
    return [t for t in later[1:] if t.joint.squares < left]


def _later_and_else(trial: Trial) -> tuple[Side, frozenset[str]] | None:
    """Side and ids of what else has changed beside what makes all come later; None where nothing does."""
    parts = trial.score.candidate.parts or (trial.score.candidate,)
    others = frozenset(part.id for part in parts if not is_only_later(part))
    return (trial.score.candidate.side, others) if len(others) == len(parts) - 1 else None


def _says_the_same(one: Trial, other: Trial) -> bool:
    """Whether two refits predict the same but for what their coordinates take up of the noise."""
    apart = sum(float(np.sum((a - b) ** 2)) for a, b in zip(one.compared, other.compared, strict=True))
    return apart < _NEAR + len(other.joint.delta) + len(one.joint.delta)
