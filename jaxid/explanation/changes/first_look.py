"""The first look: what each candidate would explain of the difference between the two sets, to first order.

Both sets are simulated at the first fit's numbers. What the shared parameters and the initial states can take up is projected
off, and the score (Lagrange-multiplier) test of each candidate's coordinates remains (Rao, Proceedings of the Cambridge
Philosophical Society 44, 1948). All is whitened for noise of the colour that the best candidate leaves, and the scores'
variance is at least what blocks of time show.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ..._distributions import chi_squared_tail
from ...effects import laws_of
from ...effects.actuator.motor_strength import OfEach
from ...effects.curve import SHAPE
from ...effects.sensor.delay import SensorDelayOfEach
from ...effects.sensor.lag import SensorLagOfEach
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..screening.probed import probed
from ..screening.probes import seen_in, standing_together
from .candidates import Candidate, Side, mechanisms_of, of_mechanism
from .joint import SIDES, STEP, Colours, Pair, block_sums, blocks_of, flat, numbers_on, project, stacked, white

Array = NDArray[np.float64]
_FAR_OFF = 3.0
"""Times the noise from which what the best candidate leaves is no noise of any colour: whitened by itself, the difference would
pass for noise."""
_UNSEEN = 1e-6
"""Change of all samples together, in units of the noise, for a coordinate's magnitude, below which nothing shows it."""
_ALIKE = 1e-6
"""Length, in those of a candidate's coordinates, below which what is left of a direction is rounding."""
_SAME = 1e-2
"""Share of a change's length that may be left of it where another makes it, too."""
_DISAGREE = 0.01
_FEW_LOGS = 2.0


@dataclass(frozen=True)
class Score:
    """What the first look says of a candidate.

    `gain` is the drop of the sum of squares with `delta` [k], its probability by chance `p_value`; `errors` [k] are the
    standard errors that each coordinate alone would have; `directions` [rows, k] are the whitened changes of both sides, what
    the shared parameters take up taken off, in units of a coordinate's magnitude. `same` are titles of candidates that are the
    same model by another name; `own` is whether it is no mechanism of the catalogue.
    """

    candidate: Candidate
    gain: float
    p_value: float
    delta: Float[np.ndarray, " k"]
    errors: Float[np.ndarray, " k"]
    directions: Float[np.ndarray, "R k"] = field(repr=False)
    own: bool
    same: tuple[str, ...] = ()

    @property
    def worth(self) -> float:
        """The gain less what its coordinates cost (Schwarz's criterion)."""
        return self.gain - len(self.delta) * float(np.log(len(self.directions)))


@dataclass(frozen=True)
class FirstLook:
    """The `scores`, the most worth first, one of each mechanism and of candidates that do the same; the `colours` that the best
    leaves; how many candidates and shapes were `tried`; what no log shows (`unseen`,
    titles); shared parameters `theta` to start from; whether the difference is `far` beyond the noise, so that white noise is
    taken."""

    scores: tuple[Score, ...]
    colours: Colours
    tried: int
    unseen: tuple[str, ...]
    theta: Float[np.ndarray, " n"]
    far: bool = False


@dataclass(frozen=True)
class _Changes:
    """A candidate's changes [k, E, T, ny] of its side, one coordinate each, per unit of `sizes`; a strength that must be
    positive."""

    candidate: Candidate
    outputs: Array
    sizes: Array
    positive: bool = False


def _own(pair: Pair) -> tuple[dict[Side, Array], list[_Changes]]:
    """Outputs [1 + n, E, T, ny] of both sides as they are and per magnitude of the shared parameters, and the changes of all
    candidates but the catalogue's mechanisms."""
    candidates, robot = pair.own, pair.robot
    theta = np.array([robot.parameters[n].value for n in pair.free])
    shared: dict[Side, Array] = {}
    found: list[_Changes] = []

    def lane(side: Side, candidate: Candidate | None, i: int, k: int) -> tuple[dict[str, float], float]:
        """The numbers with one coordinate (of `candidate`, k in all; else the i-th shared parameter) moved away from its bound,
        and the share of its magnitude by which it is moved."""
        here = numbers_on(side, robot, pair.free, candidate, theta, np.zeros(k))
        for step in (STEP, -STEP):
            t, d = theta.copy(), np.zeros(k)
            if candidate is None:
                t[i] += step * sizes[i]
            else:
                d[i] = step * candidate.coordinates[i].size
            there = numbers_on(side, robot, pair.free, candidate, t, d)
            if there != here:
                return there, step
        return here, STEP

    sizes = pair.sizes()
    for side in SIDES:
        own = pair.sides[side]
        lanes = [lane(side, None, i, 0) for i in range(len(theta))]
        mine = candidates if side == "after" else ()
        lanes += [lane(side, c, i, len(c.coordinates)) for c in mine for i in range(len(c.coordinates))]
        outputs = own.simulated(robot, [{}, *(numbers for numbers, _ in lanes)], own.nothing_moved)
        moved = (outputs[1:] - outputs[0]) / np.array([step for _, step in lanes])[:, None, None, None]
        shared[side] = np.concatenate([outputs[:1], moved[: len(theta)]])
        at = len(theta)
        for candidate in mine:
            k = len(candidate.coordinates)
            found.append(_Changes(candidate, moved[at : at + k], np.array([c.size for c in candidate.coordinates])))
            at += k
    return shared, found


def _another_change(law: Effect, usual: Effect) -> bool:
    """Whether a law is another thing that may happen, and not another formula of the usual one's: it acts on inputs that do not
    drive, which the usual one leaves alone, it is of another part of a motor (driver, magnets, winding), or of one sensor of
    several."""
    one_sensor = type(law) in (SensorLagOfEach, SensorDelayOfEach)
    return ("steered" in law.needs and "steered" not in usual.needs) or isinstance(law, OfEach) or one_sensor


def _mechanisms(
    robot: Robot,
    pair: Pair,
    known: Mapping[Side, Mapping[str, Mapping[str, float]]],
    report: Callable[[str], None],
) -> list[_Changes]:
    """The changes that mechanisms of the catalogue make where they appear or vanish: by their usual law, those laws that are
    another change, and their curve."""
    effects: list[Effect] = []
    for usual in mechanisms_of(robot):
        laws = laws_of(robot, usual.id)
        effects += [laws[0].blurred, *(law for law in laws[1:] if law.law == SHAPE or _another_change(law, laws[0]))]
    found: list[_Changes] = []
    if not effects:
        return found
    for side in SIDES:
        own = pair.sides[side]
        noise = dict(zip(own.logs.channels.measured, map(float, own.sigma), strict=True))
        seen = seen_in(robot, own.logs, noise, known[side], None)
        first, groups, _, _ = probed(robot, own.logs, standing_together(effects), [], seen, known[side], None, report)
        for group in groups:
            strengths = group.plain(group.probe.strengths)
            values = {**group.plain(group.probe.shape), **strengths}
            candidate = of_mechanism(group.effect, robot, side, values)
            names = [c.name for c in candidate.coordinates]
            moved = np.nan_to_num((group.outputs - first[0]) / own.sigma, posinf=0.0, neginf=0.0)
            moved = np.where(own.there, moved, 0.0)
            whole = np.zeros((len(names), *moved.shape[1:]))
            whole[[names.index(name) for name in strengths]] = moved
            sizes = np.array([strengths.get(name, np.nan) for name in names])
            positive = len(strengths) == 1 and group.robot.parameters[next(iter(group.probe.strengths))].lower >= 0.0
            found.append(_Changes(candidate, whole, sizes, positive))
    return found


class _Whitened:
    """Everything whitened for noise of given colours: the residual and the shared columns, initial states projected off."""

    def __init__(self, pair: Pair, shared: Mapping[Side, Array], states: Mapping[Side, Array], colours: Colours):
        self.pair, self.colours, self.states = pair, colours, {}
        self.residual, self.columns = {}, {}
        for side in SIDES:
            own = pair.sides[side]
            S = own.whiten(states[side], colours[side])
            self.states[side] = np.moveaxis(flat(S), 0, -1)
            r = own.whiten(shared[side][0] - own.observed, colours[side])
            C = own.whiten(shared[side][1:], colours[side])
            C = np.moveaxis(flat(C), 0, -1)
            self.columns[side], self.residual[side], _ = project(C, flat(r), self.states[side], own.state_stiffness)
        C = stacked(self.columns)
        size = np.linalg.norm(C, axis=0)
        U, s, _ = np.linalg.svd(C / np.where(size > 0, size, 1.0), full_matrices=False)
        self.basis = U[:, s > 1e-8 * max(s.max(initial=0.0), 1e-300)]
        y = stacked(self.residual)
        self.left = y - self.basis @ (self.basis.T @ y)

    def directions(self, changes: _Changes) -> Array:
        """[rows, k], what shared parameters and initial states take up taken off."""
        side, own = changes.candidate.side, self.pair.sides[changes.candidate.side]
        D = own.whiten(changes.outputs, self.colours[side])
        D = np.moveaxis(flat(D), 0, -1)
        D, _, _ = project(D, self.residual[side], self.states[side], own.state_stiffness)
        other: Side = "before" if side == "after" else "after"
        parts: dict[Side, Array] = {}
        parts[side], parts[other] = D, np.zeros((*self.residual[other].shape, D.shape[-1]))
        rows = stacked(parts)
        return rows - self.basis @ (self.basis.T @ rows)

    def shaped(self, rows: Array) -> dict[Side, Array]:
        """A vector of rows as [E, T, ny] of each side."""
        before, after = (self.pair.sides[s].there for s in SIDES)
        found: dict[Side, Array] = {"before": rows[: before.size].reshape(before.shape)}
        found["after"] = rows[before.size :].reshape(after.shape)
        return found


def _answer(D: Array, left: Array, positive: bool) -> tuple[Array, float]:
    """Sizes [k] that explain most, and the drop of the sum of squares."""
    size = np.linalg.norm(D, axis=0)
    size = np.where(size > 0, size, np.inf)
    delta = -np.linalg.lstsq(D / size, left, rcond=1e-8)[0] / size
    if positive and len(delta) and delta[np.argmax(np.abs(delta))] < 0.0:
        return np.zeros_like(delta), 0.0
    return delta, float(-left @ (D @ delta))


def _wider(D: Array, left: Array, blocks: NDArray[np.int64], logs: NDArray[np.int64], free: int) -> Array:
    """By how much the scores of each column scatter more than white noise would let them [k], at least one: by blocks of time,
    and between logs where that is more than chance."""
    size = np.sum(D**2, axis=0)
    size = np.where(size > 0, size, 1.0)
    u = block_sums(D * left[:, None], blocks)
    wider = np.maximum(np.sum(u**2, axis=0) / size * len(u) / max(len(u) - free, 1), 1.0)
    starts = np.flatnonzero(np.diff(logs, prepend=-1))
    own, share = np.add.reduceat(D * left[:, None], starts, axis=0), np.add.reduceat(D**2, starts, axis=0) / size
    counts = 1.0 / np.maximum(np.sum(share**2, axis=0), 1e-300)
    freedom = np.maximum(counts - 1.0, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sum(own**2, axis=0) / size / wider * counts / freedom
        chance = chi_squared_tail(ratio * freedom, freedom)
    sure = np.isfinite(ratio) & (freedom > _FEW_LOGS) & (chance < _DISAGREE)
    return np.sqrt(wider * np.where(sure, np.maximum(ratio, 1.0), 1.0))


def _statistic(
    D: Array, left: Array, remains: Array, blocks: NDArray[np.int64], logs: NDArray[np.int64], free: int
) -> tuple[float, int]:
    """The score test of the columns of `D` on what is `left`, whose scatter is that of what `remains`, and its degrees of
    freedom.

    By directions at right angles: of columns that are nearly the same, the little in which they differ scatters by itself, and
    not as each of them does.
    """
    U, s, _ = np.linalg.svd(D / np.linalg.norm(D, axis=0), full_matrices=False)
    U = U[:, s > _ALIKE]
    return float(np.sum((U.T @ left / _wider(U, remains, blocks, logs, free)) ** 2)), U.shape[1]


def first_look(
    robot: Robot,
    pair: Pair,
    known: Mapping[Side, Mapping[str, Mapping[str, float]]],
    report: Callable[[str], None] = lambda message: None,
) -> FirstLook:
    """Score everything that may have changed of `robot`, the first fit's. `known` are the estimated initial states of each
    side's logs by name; `report` is told how far the simulations are."""
    shared, changes = _own(pair)
    report("simulated with changes of the robot's own parameters")
    changes += _mechanisms(robot, pair, known, report)
    states: dict[Side, Array] = {}
    for side in SIDES:
        own = pair.sides[side]
        states[side] = np.moveaxis(own.state_columns(pair.robot, own.nothing_moved, shared[side][0]), -1, 0)
    plain = _Whitened(pair, shared, states, white(pair))
    best, worth = plain.left, -np.inf
    for change in changes:
        D = plain.directions(change)
        delta, gain = _answer(D, plain.left, change.positive)
        if gain - len(delta) * np.log(len(D)) > worth:
            best, worth = plain.left + D @ delta, gain - len(delta) * np.log(len(D))
    left = plain.shaped(best)
    far = float(np.sqrt(np.mean(np.square(np.concatenate([left[s][pair.sides[s].there] for s in SIDES]))))) > _FAR_OFF
    colours: Colours = white(pair) if far else {s: pair.sides[s].colours(left[s]) for s in SIDES}
    view = _Whitened(pair, shared, states, colours)
    every = [(change, view.directions(change)) for change in changes]
    answers = [_answer(D, view.left, change.positive) for change, D in every]
    worths = [gain - len(delta) * np.log(len(view.left)) for delta, gain in answers]
    k = int(np.argmax(worths))
    remains = view.left + every[k][1] @ answers[k][0]
    shaped = view.shaped(remains)
    blocks = stacked(blocks_of(pair, shaped)).astype(np.int64)
    logs = np.concatenate(
        [np.repeat(np.arange(len(r)) + i * 10_000_000, r.shape[1]) for i, r in enumerate(view.residual.values())]
    )
    scores, unseen = [], []
    for (change, D), (delta, gain) in zip(every, answers, strict=True):
        size = np.linalg.norm(D, axis=0)
        shown = size > _UNSEEN
        if not shown.any():
            unseen.append(change.candidate.title)
            continue
        wider = _wider(D, remains, blocks, logs, view.basis.shape[1])
        statistic, freedom = _statistic(D[:, shown], view.left, remains, blocks, logs, view.basis.shape[1])
        statistic = statistic if gain > 0 else 0.0
        p = float(chi_squared_tail(statistic, max(freedom, 1)))
        with np.errstate(divide="ignore"):
            errors = np.abs(change.sizes) * wider / size
        start = np.where(np.isfinite(change.sizes), delta * np.nan_to_num(change.sizes), change.candidate.start or 0.0)
        scores.append(Score(change.candidate, statistic, p, start, errors, D, change.candidate in pair.own))
    theta = np.array([pair.robot.parameters[n].value for n in pair.free])
    step = -np.linalg.lstsq(stacked(view.columns), stacked(view.residual) + every[k][1] @ answers[k][0], rcond=1e-8)[0]
    shown = {score.candidate.title for score in scores}  # by another of its laws, say
    scores = _without_doubles(scores)
    return FirstLook(
        tuple(_one_of_each(scores)),
        colours,
        len(scores),
        tuple(title for title in dict.fromkeys(unseen) if title not in shown),
        theta + step * pair.sizes(),
        far,
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
