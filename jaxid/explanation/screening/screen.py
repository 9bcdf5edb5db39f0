"""Screening: which effects could explain what the fitted model leaves over.

The score (Lagrange-multiplier) test with finite steps: the change that each candidate makes to the simulation at the
baseline fit, projected off the changes that the fitted parameters can make themselves, is compared with the residual.
The simulations are lanes of one program for every mechanism (`probed.py`).
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._float64 import in_float64
from ...effects.curve import SHAPE, Curve
from ...estimate.noise_colour import Colour, colour_of
from ...logs import LogSet
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..policy import current_policy
from ..refits.smoothed_angles import Angles
from .probed import Group, probed
from .probes import seen_in, standing_together

_NO_EDGE = 0.1
"""Share of the farthest of several edges within which another is next to zero."""
_WHITE = Colour((), 1.0, 0.0)
_STARTS = 2
"""Starts that an effect with a shape (a line, a speed, a number of periods) is refitted from."""
_SAME = 1e-3
"""Smallest singular value of changes of length one below which a curve is held at one of its heights."""
_OUTLIER = 4.0
"""Whitened residual, in its own standard deviations, beyond which a sample counts for no more."""
_STEP = 1e-3
"""Step of the fitted parameters' secants, in units of their magnitude."""


@dataclass(frozen=True)
class Candidate:
    """One effect's score: of one law of a mechanism, with the candidates of its other `laws`, best first.

    `gain` is the drop of the sum of squares (in units of the noise) that the effect promises with all fitted parameters
    re-estimated, to first order, less what its parameters and the shapes looked at cost; `in_colour` the same of the whitened
    residual, what the best candidate leaves taken for coloured noise; `share` the part of the excess over the noise floor;
    `starts` the values to begin refits from, best first. `direction` is the change of the simulation (in
    units of the noise, fitted parameters projected off, of length one) by which it explains. `out_of` is how many shapes of it
    were looked at. `held` are parameters that stay at zero, since the others and the fitted ones do all that they can, or
    nothing that is measured shows them.
    """

    effect: Effect
    gain: float
    share: float
    starts: tuple[dict[str, float], ...]
    direction: NDArray[np.float32] = field(repr=False, compare=False)
    out_of: int = 1
    held: tuple[str, ...] = ()
    in_colour: float = 0.0
    laws: tuple["Candidate", ...] = ()

    def like(self, other: "Candidate") -> bool:
        """Whether the two explain by the same change, so that only refits can tell them apart."""
        if self.direction.shape != other.direction.shape:  # of whole logs and of windows
            return False
        return abs(float(self.direction @ other.direction)) > current_policy().alike


def alike_to(identifier: str, candidates: Sequence[Candidate], without: Collection[str]) -> list[Candidate]:
    """The candidates that explain by the same change as that of the effect `identifier`, but for those of the ids `without`."""
    first = next((c for c in candidates if c.effect.id == identifier), None)
    return [c for c in candidates if first is not None and c.like(first) and c.effect.id not in without]


class _Scored(NamedTuple):
    """What one probe of a law promises: its `score`, the `start` of a refit and where the fitted parameters would have
    `given_way` to, and which of its strengths are shown `nowhere`."""

    score: float
    start: dict[str, float]
    given_way: dict[str, float]
    group: Group
    direction: NDArray[np.float32]
    nowhere: tuple[str, ...]


@in_float64
def screen(
    robot: Robot,
    logs: LogSet,
    effects: Sequence[Effect],
    noise: Mapping[str, float],
    known_states: Mapping[str, Mapping[str, float]],
    angles: Angles | None = None,
    report: Callable[[str], None] = lambda message: None,
    colours: Mapping[str, Colour] | None = None,
) -> list[Candidate]:
    """Score `effects`, several laws of a mechanism among them, on a fitted `robot` that lacks them: one candidate for every
    mechanism, best first, by the formula that promises most (by its curve where that promises far more).

    `known_states` are estimated initial states, `angles` those of the wheels if they have to be prescribed. `report`
    is told how far the simulations are. `colours` are those of the noise, by channel, where it is not to be taken for what the
    best candidate leaves: of noise that a controller feeds back a delay or a lag explains much that is none.
    """
    own = list(robot.parameters.free_names)
    base = robot.parameters.numbers
    steps = [max(abs(robot.parameters[name].value), robot.parameters[name].typical or 0.0) * _STEP for name in own]
    secants = [{name: base[name] + step} for name, step in zip(own, steps, strict=True)]
    pairs = standing_together(effects)
    repeating = next((effect for effect in effects if effect.repeats), None)
    seen = seen_in(robot, logs, noise, known_states, repeating)
    first, found, columns, prescribed = probed(robot, logs, pairs, secants, seen, known_states, angles, report)
    here = first[0].copy()
    weights, measured = _weights(robot, logs, {name: level for name, level in noise.items() if name not in prescribed})
    residual = (np.where(weights > 0, here - measured, 0.0) * weights).ravel()
    # In place: together they are the largest array of an explanation.
    moved = np.concatenate([first[1:], *(group.outputs for group in found)])
    with np.errstate(over="ignore", invalid="ignore"):  # simulations that diverge, which count for nothing
        moved -= here
        moved *= weights
    moved = moved.reshape(len(moved), -1)
    unseen = ~np.any(moved, axis=1)[len(own) :]
    moved[~np.all(np.isfinite(moved), axis=1)] = 0.0
    basis, triangle = np.linalg.qr(moved[: len(own)].T)
    whole = residual
    residual = residual - basis @ (basis.T @ residual)
    excess = max(float(residual @ residual) - np.count_nonzero(weights), 1.0)
    scored: dict[Effect, list[_Scored]] = {}
    explained = 0.0, np.zeros_like(residual)
    for group, mine in zip(found, columns, strict=True):
        block = moved[len(own) :][mine]
        block = block - (block @ basis) @ basis.T
        useful = np.linalg.norm(block, axis=1) > 1e-6
        if group.effect.law == SHAPE and not _each_counts(block[useful]):
            first = isinstance(group.effect, Curve) and group.effect.begins_later
            useful[np.flatnonzero(useful)[0 if first else -1]] = False
        if not useful.any():
            continue
        names = [name for name, ok in zip(group.probe.strengths, useful, strict=True) if ok]
        gain, start, change = _promise(group, names, block[useful], residual)
        # How the fitted parameters would give way, to first order: what the effect had been mistaken for.
        plain = moved[len(own) :][mine][useful]
        size = _sizes(group, names, start)
        shift = -np.linalg.lstsq(triangle, basis.T @ (whole + plain.T @ size), rcond=1e-6)[0] * np.array(steps)
        given_way = {n: _inside(robot, n, base[n] + d) for n, d in zip(own, shift, strict=True)}
        score = gain - _price(group, names, residual)
        explained = max(explained, (score, change), key=lambda entry: entry[0])
        direction = (change / max(float(np.linalg.norm(change)), 1e-300)).astype(np.float32)
        nowhere = _shown_nowhere(group, unseen[mine])
        scored.setdefault(group.effect, []).append(
            _Scored(score, group.plain(start), given_way, group, direction, nowhere)
        )
    left = np.where(weights > 0, (residual + explained[1]).reshape(weights.shape), np.nan)
    each = [
        colour_of(list(left[:, :, i])) if colours is None else colours.get(name, _WHITE)
        for i, name in enumerate(logs.channels.measured)
    ]
    in_colour = _in_colour(found, columns, each, whole, moved, len(own), weights)
    candidates = []
    for tried in scored.values():
        tried.sort(key=lambda entry: -entry.score)
        score, group, direction = tried[0].score, tried[0].group, tried[0].direction
        best = _with_all_edges(tried)[: _STARTS if len(tried[0].start) > 1 else 1]
        starts = tuple(start for own in best for start in (own.start, {**own.given_way, **own.start}))
        share = float(score / excess)
        coloured = in_colour.get(group.effect, float(score))
        whole = group.plain(group.probe.strengths) if group.effect.law == SHAPE else {}
        held = tuple(name for name in whole if name not in starts[0])
        held = held or tried[0].nowhere
        out_of = group.probe.out_of
        candidates.append(Candidate(group.effect, float(score), share, starts, direction, out_of, held, coloured))
    return _by_mechanism(candidates)


def _with_all_edges(tried: list[_Scored]) -> list[_Scored]:
    """Those that begin with none of several edges next to zero, from where nothing leads to another place; all, where there are
    none."""
    group = tried[0].group
    if group.effect.sharp == group.effect.blurred:
        return tried
    lowest = group.plain({name: group.robot.parameters[name].lower for name in group.probe.strengths})
    edges = [[x for name, x in own.start.items() if lowest.get(name, -np.inf) >= 0.0] for own in tried]
    begun = [own for own, of in zip(tried, edges, strict=True) if all(edge > _NO_EDGE * max(of) for edge in of)]
    return begun or tried


def _shown_nowhere(group: Group, unseen: NDArray[np.bool_]) -> tuple[str, ...]:
    """The group's strengths, zero where nothing is wrong, that change nothing that the logs measure: such as of a sensor that
    they lack."""
    names = (name for name, none in zip(group.probe.strengths, unseen, strict=True) if none)
    table = group.robot.parameters
    return tuple(group.plain({n: 0.0 for n in names if n in table and table[n].free and table[n].value == 0.0}))


def _by_mechanism(candidates: Sequence[Candidate]) -> list[Candidate]:
    """One candidate for every mechanism, with the others of its laws, best first."""
    laws: dict[str, list[Candidate]] = {}
    least = current_policy().formula
    for candidate in candidates:
        laws.setdefault(candidate.effect.id, []).append(candidate)
    first = []
    for own in laws.values():
        own.sort(key=lambda c: -c.gain)
        # A formula comes before the curve, unless it promises much less.
        formula = next((c for c in own if c.effect.law != SHAPE and c.gain > least * own[0].gain), own[0])
        own.remove(formula)
        own.insert(0, formula)
        coloured = max(c.in_colour for c in own)
        first.append(replace(own[0], laws=tuple(own[1:]), in_colour=coloured))
    return sorted(first, key=lambda candidate: -candidate.gain)


def _each_counts(block: NDArray) -> bool:
    """Whether none of the changes [n, N] is all but a sum of the others."""
    sizes = np.linalg.norm(block, axis=1, keepdims=True)
    return len(block) < 2 or float(np.linalg.svd(block / sizes, compute_uv=False)[-1]) > _SAME


def _price(group: Group, names: Sequence[str], residual: NDArray) -> float:
    """What the gain of a group must pay for its parameters and for the shapes looked at."""
    return len(names) * float(np.log(residual.size)) + 2.0 * float(np.log(group.probe.out_of))


def _in_colour(
    found: Sequence[Group],
    columns: Sequence[list[int]],
    colours: Sequence[Colour],
    whole: NDArray,
    moved: NDArray,
    own: int,
    weights: NDArray,
) -> dict[Effect, float]:
    """The gains of effects once all is whitened for noise of the channels' `colours`; empty where that is white.

    `whole` is the residual and `moved` [P, E T ny] the changes, of the `own` fitted parameters first, all in units of the
    noise. Gains are then in units of independent samples, which those of coloured noise are not.
    """
    there = weights > 0
    if not any(colour.order for colour in colours):
        return {}

    def whitened(rows: NDArray) -> NDArray:
        """Rows [n, E T ny]; a few at a time, since all together are a copy of every simulation."""
        white = np.zeros((len(rows), *weights.shape))
        for i, colour in enumerate(colours):
            for e in range(len(weights)):
                white[:, e, :, i] = colour.whiten(rows.reshape(white.shape)[:, e, :, i], there[e, :, i])
        return white.reshape(len(rows), -1)

    basis, _ = np.linalg.qr(whitened(moved[:own]).T)
    # An outlier would be explained by whatever is large where it is.
    residual = np.clip(whitened(whole[None])[0], -_OUTLIER, _OUTLIER)
    residual = residual - basis @ (basis.T @ residual)
    gains: dict[Effect, float] = {}
    for group, mine in zip(found, columns, strict=True):
        block = whitened(moved[own:][mine])
        block = block - (block @ basis) @ basis.T
        useful = np.linalg.norm(block, axis=1) > 1e-6
        if useful.any():
            names = [name for name, ok in zip(group.probe.strengths, useful, strict=True) if ok]
            gain = _promise(group, names, block[useful], residual)[0] - _price(group, names, residual)
            gains[group.effect] = max(gain, gains.get(group.effect, -np.inf))
    return gains


def _sizes(group: Group, names: Sequence[str], start: Mapping[str, float]) -> NDArray:
    """The start's strengths in units of the probes'."""
    strengths, limits, table = group.probe.strengths, group.probe.limits, group.robot.parameters
    if not limits:
        none = {name: table[name].value for name in names}
        return np.array([(start[name] - none[name]) / (strengths[name] - none[name]) for name in names])
    return np.array([(limits[name] - 1 / start[name]) / (limits[name] - 1 / strengths[name]) for name in names])


def _inside(robot: Robot, name: str, value: float) -> float:
    """A start for a parameter that a first-order step may have taken out of its bounds."""
    now, lower, upper = (getattr(robot.parameters[name], field) for field in ("value", "lower", "upper"))
    value = max(value, lower + 0.05 * abs(now - lower)) if np.isfinite(lower) else value
    return min(value, upper - 0.05 * abs(upper - now)) if np.isfinite(upper) else value


def _promise(
    group: Group, names: list[str], block: NDArray, residual: NDArray
) -> tuple[float, dict[str, float], NDArray]:
    """Drop of the sum of squares to first order, the parameters at which it is expected, and the change that makes it."""
    coefficients, *_ = np.linalg.lstsq(block.T, -residual, rcond=1e-8)
    strengths, limits, table = group.probe.strengths, group.probe.limits, group.robot.parameters
    if limits:
        # What a limit cuts off grows with its distance from the largest signal.
        c = np.clip(coefficients, 0.0, 1.5)
        start = {
            name: 1.0 / (limits[name] - share * (limits[name] - 1.0 / strengths[name]))
            for name, share in zip(names, c, strict=True)
        }
        if not np.any(c > 0):
            start = {name: strengths[name] for name in names}
        change = block.T @ c
        return float(-2 * change @ residual - change @ change), start, change
    change = block.T @ coefficients
    gain = float(-change @ residual)
    # An effect's own parameters are zero where it is absent, those that it frees of the robot are what the table says.
    none = {name: table[name].value for name in names}
    steps = {name: strengths[name] - none[name] for name in names}
    values = {name: float(none[name] + c * steps[name]) for name, c in zip(names, coefficients, strict=True)}
    # A strength that must be positive explains nothing with the wrong sign.
    if len(values) == 1 and any(value < table[name].lower for name, value in values.items()):
        gain = 0.0
    return gain, {**group.probe.shape, **{n: table[n].inside(value) for n, value in values.items()}}, change


def _weights(robot: Robot, logs: LogSet, noise: Mapping[str, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """1/noise where a channel was measured that the fit counts (an output, or a state), and the measurements, [E, T, ny]."""
    batch = logs.batch()
    counted = [name in logs.channels.outputs or name in robot.states for name in batch.channels.measured]
    levels = np.array(
        [noise.get(n, np.nan) if ok else np.nan for n, ok in zip(batch.channels.measured, counted, strict=True)]
    )
    weights = np.where(np.isfinite(levels) & (levels > 0), 1.0 / np.where(levels > 0, levels, 1.0), 0.0)
    return np.where(np.asarray(batch.mask), weights, 0.0), np.asarray(batch.outputs)
