"""Both sets of logs under one model of which a candidate may differ: refits by generalised least squares.

Gauss-Newton on whitened residuals (Aitken 1935), with secants: the shared free parameters, the candidate's coordinates and the
initial states that the fits estimated. Steps that do not come nearer are halved.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ...estimate.noise_colour import Colour
from ...estimate.output_error.robust_covariance import memory
from ...robots.robot import Robot
from .candidates import Candidate, Numbers, Side, candidates_of
from .sides import STEP, SetOfLogs

Array = NDArray[np.float64]
Colours = dict[Side, tuple[Colour, ...]]
SIDES: tuple[Side, Side] = ("before", "after")
_STEPS, _HALVINGS = 12, 4
_ENOUGH = 0.01
"""Drop of the sum of squares below which a step is the last."""
_SINGULAR = 1e-9
_MEMORIES, _SHORTEST, _FEWEST = 10.0, 10, 30
"""Length of a block in correlation times of the residual, in samples at least, and how many blocks there must be."""


@dataclass(frozen=True)
class Pair:
    """The two sets of logs and the `robot`, with the numbers of the first fit, whose parameters `free` both share. It carries
    what the `own` candidates (all but the catalogue's mechanisms) need, which is absent."""

    robot: Robot
    free: tuple[str, ...]
    sides: dict[Side, SetOfLogs]
    own: tuple[Candidate, ...]

    @classmethod
    def of(cls, robot: Robot, free: tuple[str, ...], sides: dict[Side, SetOfLogs]) -> "Pair":
        """The pair with all that may change of `robot` itself."""
        own = tuple(candidates_of(robot))
        for candidate in own:
            robot = with_candidate(robot, candidate)
        return cls(robot, free, sides, own)

    def sizes(self) -> Array:
        """Magnitudes of the shared parameters [n]."""
        table = self.robot.parameters
        return np.array([abs(table[n].value) or table[n].typical or 1.0 for n in self.free])


@dataclass(frozen=True)
class Joint:
    """A refit. `theta` are the shared parameters, `delta` the candidate's coordinates (empty for none), `residuals`
    [E, T, ny] of each side in units of its noise, not whitened, `squares` those whitened; `covariance` of `delta`, wide enough
    for what whitening has left."""

    candidate: Candidate | None
    theta: Float[np.ndarray, " n"]
    delta: Float[np.ndarray, " k"]
    squares: float
    residuals: dict[Side, Array] = field(repr=False)
    covariance: Float[np.ndarray, "k k"] = field(repr=False)
    states: dict[Side, Array] = field(repr=False)


def with_candidate(robot: Robot, candidate: Candidate | None) -> Robot:
    """The robot that carries what the candidate needs, which is absent."""
    for effect in candidate.effects if candidate is not None else ():
        robot = robot if effect in robot.effects else robot + effect
    return robot


def inside(robot: Robot, numbers: Numbers) -> dict[str, float]:
    """The numbers, put on their bounds where they lie outside."""
    table = robot.parameters
    return {n: table[n].inside(x) for n, x in numbers.items()}


def numbers_on(
    side: Side, robot: Robot, free: Sequence[str], candidate: Candidate | None, theta: Array, delta: Array
) -> dict[str, float]:
    """What differs from the robot's own numbers on one side."""
    shared = dict(zip(free, map(float, theta), strict=True))
    if candidate is not None and candidate.side == side:
        shared |= candidate.move({**robot.parameters.numbers, **shared}, delta)
    return inside(robot, shared)


def within(robot: Robot, free: Sequence[str], candidate: Candidate | None, theta: Array, delta: Array) -> Array:
    """The candidate's coordinates, those that would take a number out of its bounds put on them."""
    if candidate is None:
        return delta
    table, found = robot.parameters, np.array(delta, float)
    shared = {**table.numbers, **dict(zip(free, map(float, theta), strict=True))}
    for i, c in enumerate(candidate.coordinates):
        name = c.of or c.name
        if name in table:
            base = inside(robot, {name: shared[name]})[name] if c.of else 0.0
            found[i] = np.clip(found[i], table[name].lower - base, table[name].upper - base)
    return found


def project(columns: Array, residual: Array, states: Array, stiffness: Array) -> tuple[Array, Array, list[Array]]:
    """`columns` [E, N, n] and `residual` [E, N] of each log less what its own initial states' columns [E, N, s] take up, and
    the matrices [s, N] that give the states' steps."""
    if not states.shape[-1]:
        return columns, residual, [np.zeros((0, residual.shape[1]))] * len(residual)
    columns, residual, answers = columns.copy(), residual.copy(), []
    for e, S in enumerate(states):
        used = np.linalg.norm(S, axis=0) > 0
        gram = S.T @ S + np.diag(np.where(used, stiffness**2, 1.0))
        onto = np.linalg.lstsq(gram, S.T, rcond=1e-12)[0]
        columns[e] -= S @ (onto @ columns[e])
        residual[e] -= S @ (onto @ residual[e])
        answers.append(onto)
    return columns, residual, answers


def flat(values: Float[np.ndarray, "*K E T ny"]) -> Float[np.ndarray, "*K E N"]:
    """Samples and channels of each log in one row."""
    return values.reshape(*values.shape[:-2], values.shape[-2] * values.shape[-1])


@dataclass(frozen=True)
class _Linear:
    """Whitened residuals [E, N] and columns [E, N, n + k] of each side, less the states'; what these answer."""

    residual: dict[Side, Array]
    columns: dict[Side, Array]
    whole: dict[Side, tuple[Array, Array]]
    answers: dict[Side, list[Array]]


def _moved(
    robot: Robot, pair: Pair, candidate: Candidate | None, side: Side, theta, delta, i: int
) -> tuple[dict, float]:
    """The numbers with the i-th unknown moved by a secant's step, away from its bound."""
    n = len(theta)
    sizes = [*pair.sizes(), *((c.size for c in candidate.coordinates) if candidate else ())]
    now = theta[i] if i < n else delta[i - n]
    step = STEP * max(abs(now), sizes[i]) if i < n else STEP * sizes[i]
    here = numbers_on(side, robot, pair.free, candidate, theta, delta)
    for sign in (1.0, -1.0):
        t, d = theta.copy(), delta.copy()
        if i < n:
            t[i] += sign * step
        else:
            d[i - n] += sign * step
        there = numbers_on(side, robot, pair.free, candidate, t, d)
        if sign > 0 and there == here and i < n:
            continue
        return there, sign * step
    return here, step


def _residuals(pair: Pair, robot: Robot, candidate: Candidate | None, theta, delta, states) -> dict[Side, Array]:
    found: dict[Side, Array] = {}
    for side in SIDES:
        own = pair.sides[side]
        change = numbers_on(side, robot, pair.free, candidate, theta, delta)
        found[side] = own.simulated(robot, [change], states[side])[0] - own.observed
    return found


def _squares(pair: Pair, residuals: Mapping[Side, Array], colours: Colours) -> float:
    return float(sum(np.sum(pair.sides[s].whiten(residuals[s], colours[s]) ** 2) for s in SIDES))


def _linear(pair: Pair, robot: Robot, candidate: Candidate | None, theta, delta, states, colours: Colours) -> _Linear:
    n, k = len(theta), len(delta)
    residual: dict[Side, Array] = {}
    columns: dict[Side, Array] = {}
    whole: dict[Side, tuple[Array, Array]] = {}
    answers: dict[Side, list[Array]] = {}
    for side in SIDES:
        own, mine = pair.sides[side], candidate is not None and candidate.side == side
        change = numbers_on(side, robot, pair.free, candidate, theta, delta)
        moves = [_moved(robot, pair, candidate, side, theta, delta, i) for i in range(n + k * mine)]
        outputs = own.simulated(robot, [change, *(there for there, _ in moves)], states[side])
        steps = np.array([step for _, step in moves])[:, None, None, None]
        secants = np.zeros((n + k, *outputs.shape[1:]))
        secants[: len(moves)] = (outputs[1:] - outputs[0]) / steps
        own_states = np.moveaxis(own.state_columns(robot.with_values(**change), states[side], outputs[0]), -1, 0)
        r = flat(own.whiten(outputs[0] - own.observed, colours[side]))
        C = np.moveaxis(flat(own.whiten(secants, colours[side])), 0, -1)
        S = np.moveaxis(flat(own.whiten(own_states, colours[side])), 0, -1)
        whole[side] = r, C
        columns[side], residual[side], answers[side] = project(C, r, S, own.state_stiffness)
    return _Linear(residual, columns, whole, answers)


def stacked(parts: Mapping[Side, Array]) -> Array:
    """Rows of both sides, one after the other: [E, N, n] to [E_before N + E_after N, n], or of [E, N] a vector."""
    return np.concatenate([parts[s].reshape(-1, *parts[s].shape[2:]) for s in SIDES])


def blocks_of(pair: Pair, residuals: Mapping[Side, Array]) -> dict[Side, Array]:
    """Number of the block of time that each row [E, N] belongs to: longer than the whitened residual [E, T, ny] remembers."""
    found, first = {}, 0
    for side in SIDES:
        own = pair.sides[side]
        E, T, ny = own.there.shape
        samples = int(own.there.any(axis=-1).sum())
        length = _MEMORIES * memory(residuals[side], own.there)
        length = int(np.clip(np.ceil(length), _SHORTEST, max(samples // _FEWEST, _SHORTEST)))
        per_log = -(-T // length)
        number = first + np.arange(E)[:, None] * per_log + np.arange(T)[None, :] // length
        found[side] = np.repeat(number[:, :, None], ny, axis=2).reshape(E, -1)
        first += E * per_log
    return found


def block_sums(rows: Float[np.ndarray, "R k"], blocks: NDArray[np.int64]) -> Float[np.ndarray, "b k"]:
    """Sums of the rows of each block, blocks without anything left out."""
    order = np.argsort(blocks, kind="stable")
    starts = np.flatnonzero(np.diff(blocks[order], prepend=-1))
    sums = np.add.reduceat(rows[order], starts, axis=0)
    return sums[np.any(sums != 0.0, axis=1)]


def _inverse(columns: Array) -> Array:
    """(CᵀC)⁻¹ in directions that the rows tell."""
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0, size, np.inf)
    return np.linalg.pinv((columns / size).T @ (columns / size), rcond=_SINGULAR, hermitian=True) / np.outer(size, size)


def _covariance(pair: Pair, linear: _Linear) -> Array:
    """Covariance of all unknowns, every standard error the larger of that of white residuals and that of scores by blocks."""
    C, r = stacked(linear.columns), stacked(linear.residual)
    inverse = _inverse(C)
    shaped: dict[Side, Array] = {s: linear.residual[s].reshape(pair.sides[s].there.shape) for s in SIDES}
    u = block_sums(C * r[:, None], stacked(blocks_of(pair, shaped)).astype(np.int64))
    few = len(u) / max(len(u) - C.shape[1], 1)
    by_blocks = np.diag(inverse @ (u.T @ u) @ inverse) * few
    with np.errstate(divide="ignore", invalid="ignore"):
        wider = np.sqrt(np.maximum(np.nan_to_num(by_blocks / np.diag(inverse), nan=1.0), 1.0))
    return inverse * np.outer(wider, wider)


def refit(
    pair: Pair,
    candidate: Candidate | None,
    colours: Colours,
    theta: Float[np.ndarray, " n"],
    delta: Float[np.ndarray, " k"] | None = None,
    states: Mapping[Side, Array] | None = None,
    steps: int = _STEPS,
) -> Joint:
    """The joint model in which `candidate` differs (none: nothing), from `theta` and `delta`, by so many steps at most."""
    robot = with_candidate(pair.robot, candidate)
    k = len(candidate.coordinates) if candidate is not None else 0
    theta = np.array(theta, float)
    delta = np.zeros(k) if delta is None else np.array(delta, float)
    at: dict[Side, Array] = {s: (states[s] if states else pair.sides[s].nothing_moved).copy() for s in SIDES}
    residuals = _residuals(pair, robot, candidate, theta, delta, at)
    now = _squares(pair, residuals, colours)
    linear = None
    for _ in range(steps):
        linear = _linear(pair, robot, candidate, theta, delta, at, colours)
        C, r = stacked(linear.columns), stacked(linear.residual)
        size = np.linalg.norm(C, axis=0)
        size = np.where(size > 0, size, np.inf)
        step = -np.linalg.lstsq(C / size, r, rcond=1e-8)[0] / size
        there = within(robot, pair.free, candidate, theta + step[: len(theta)], delta + step[len(theta) :])
        held = (there != delta + step[len(theta) :]) & (there == delta)
        if held.any():  # on its bound already, and outwards: the others without it
            size[len(theta) :][held] = np.inf
            step = -np.linalg.lstsq(C / size, r, rcond=1e-8)[0] / size
        before = now
        for halved in range(_HALVINGS):
            share = 0.5**halved
            t = theta + share * step[: len(theta)]
            d = within(robot, pair.free, candidate, t, delta + share * step[len(theta) :])
            then = {}
            for s in SIDES:
                whole_r, whole_C = linear.whole[s]
                own = np.stack([-a @ (whole_r[e] + whole_C[e] @ step) for e, a in enumerate(linear.answers[s])])
                then[s] = at[s] + share * own if own.shape[1] else at[s]
            tried = _residuals(pair, robot, candidate, t, d, then)
            squares = _squares(pair, tried, colours)
            if squares < now:
                theta, delta, at, residuals, now = t, d, then, tried, squares
                break
        if not now < before - _ENOUGH:
            break
    assert linear is not None
    covariance = _covariance(pair, linear)[len(theta) :, len(theta) :]
    return Joint(candidate, theta, delta, now, residuals, covariance, at)


def white(pair: Pair) -> Colours:
    """White noise of the size that the logs' noise has, in every channel of both sides."""
    return {side: (Colour((), 1.0, 0.0),) * len(pair.sides[side].sigma) for side in SIDES}


def weighed(pair: Pair, joint: Joint, colours: Colours) -> float:
    """The sum of a refit's squares, whitened for noise of other colours."""
    return _squares(pair, joint.residuals, colours)
