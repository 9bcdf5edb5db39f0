"""Forces that a model may lack and its residual still shows: the score test (Lagrange multiplier, Rao 1948).

Whiteness and correlation with what was commanded are tests against anything, and so weak against any one thing: a drag or
a rise of friction towards standstill can bias every parameter by many standard errors and leave a residual that both pass.
So the directions in which the simulation would move if such a force were added, from nothing, are held against the
residual, after what the fitted parameters and initial states could have taken up. With white noise a direction of length
one finds a standard normal number there; with coloured noise its variance follows from the residual's autocovariance.
What shows in several directions by a little each is looked for in all of them at once. Beside forces, two things that
happen to commands on their way are looked for: a delay, and a dead zone.

Commands that were rounded before they were logged move a simulation along these directions, too, and with a position that
integrates by more than its noise lets pass. What they do is drawn, and allowed for.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ..._compile import compiled
from ..._distributions import f_tail, student_tail
from ...logs import LogSet
from ...robots.robot import Robot
from ..lacking import HINT, WAYS, Neglected, probed, ways_of, words_of
from ..noise_colour import Colour, made_white
from ..residual_tests import FALSE_ALARM as COLOURED
from ..residual_tests import whiteness
from ..rounded_inputs import as_they_may_have_been, written_step
from ..rounding import noise_below, shows, step_of
from .direct import sensitivities_directly
from .evaluation import simulated_with
from .laid_out import direct
from .lanes import Operation, ask
from .problem import Problem, Structure, Unknowns, experiments, parameters_at, residual_weights, whitened
from .robust_covariance import stationary

_OWN = 1e-6
"""Share of a direction that must be its own, beside what parameters and initial states do."""
_INNER = 0.02
"""Dead zone, in shares of the largest input, by which a simulation is changed to see what one does."""
_ALIKE = 1e-6
"""Share of the largest eigenvalue below which directions are one and the same."""
_DRAWS, _SEED = 12, 61
_PLAIN = 0.3
"""Root mean square, in units of the noise, from which what rounding of the inputs makes would show in the residual's size."""
_FEWEST = 30
"""Samples, less what is fitted to them, below which nothing is asked."""
Array = NDArray[np.float64]


def _sensitivities(structure: Structure, added: tuple[str, ...], problem: Problem, unknowns: Unknowns):
    """Weighted residual [E, T, ny] and its derivative by own parameters, those `added`, and initial states."""
    theta = jnp.concatenate([parameters_at(problem, unknowns.z), jnp.zeros(len(added))])
    full = structure._replace(names=(*structure.names, *added))
    ones = jnp.ones_like(theta)
    return jax.vmap(lambda *own: whitened(full, problem, theta, ones, *own))(*experiments(problem, unknowns))


_compiled = compiled(_sensitivities, static_argnums=(0, 1))


@partial(compiled, static_argnums=(0, 1))
def _look_many(structure: Structure, added: tuple[str, ...], problems: Problem, unknowns: Unknowns, others: tuple[()]):
    return jax.vmap(lambda problem, at: _sensitivities(structure, added, problem, at))(problems, unknowns)


_LOOK = Operation("neglected", _look_many, lambda both, logs, samples: tuple(x[:logs, :samples] for x in both))


def _look(structure: Structure, added: tuple[str, ...], problem: Problem, unknowns: Unknowns):
    d = direct(structure._replace(names=(*structure.names, *added)), problem)
    if d is None:
        together = ask(_LOOK, structure, added, problem, unknowns)
        return _compiled(structure, added, problem, unknowns) if together is None else together
    theta = np.concatenate([np.asarray(parameters_at(problem, unknowns.z)), np.zeros(len(added))])
    return sensitivities_directly(d, theta, np.asarray(unknowns.states))


def _on_the_way(structure: Structure, problem: Problem, unknowns: Unknowns) -> Array:
    """What a delay of one sample, and a small dead zone of every input, do to the weighted residual [E, T, ny, 2]."""
    inputs = np.asarray(problem.inputs)
    late = np.concatenate([inputs[:, :1], inputs[:, :-1]], axis=1)
    largest = np.abs(inputs).max(axis=(0, 1), keepdims=True)
    less = np.sign(inputs) * np.maximum(np.abs(inputs) - _INNER * largest, 0.0)
    weight = residual_weights(problem)
    here, *there = simulated_with([inputs, late, less], structure, problem, unknowns)
    return np.stack([np.where(weight > 0.0, y - here, 0.0) * weight for y in there], axis=-1)


def _by_rounding(logs: LogSet, structure: Structure, problem: Problem, unknowns: Unknowns) -> Array | None:
    """Draws of what rounding of the logged inputs does to the weighted residual [k, E, T, ny]; None where they were not
    rounded, or so coarsely that it would show."""
    steps = [written_step(logs, name) for name in logs.channels.inputs]
    if not any(steps):
        return None
    rng, inputs = np.random.default_rng(_SEED), np.asarray(problem.inputs)
    acted = [np.stack([as_they_may_have_been(own, steps, rng) for own in inputs]) for _ in range(_DRAWS)]
    here, *there = simulated_with([inputs, *acted], structure, problem, unknowns)
    weight = residual_weights(problem)
    drawn = np.stack([np.where(weight > 0.0, y - here, 0.0) * weight for y in there])
    size = np.sqrt(np.sum(drawn**2) / (_DRAWS * max(np.count_nonzero(weight), 1)))
    return drawn if 0.0 < size < _PLAIN else None


def _by_coarse_readings(logs: LogSet, problem: Problem, residual: Array) -> Array | None:
    """Draws of what rounding of the readings leaves in the weighted `residual` [k, E, T, ny], whatever place each counter began
    at; None where none is coarse. Where the robot rests or creeps such a rounding stays what it is, as no noise does."""
    rng, weight, read = np.random.default_rng(_SEED), residual_weights(problem), np.asarray(problem.outputs)
    with np.errstate(divide="ignore", invalid="ignore"):
        model = np.where(weight > 0.0, read + residual / weight, np.nan)
    drawn = np.zeros((_DRAWS, *residual.shape))
    for c, name in enumerate(logs.channels.measured):
        step, here = step_of(logs, name), weight[..., c] > 0.0
        off = (model - read)[..., c][here]
        if not (step and off.size and shows(step, float(np.sqrt(np.mean(off**2))))):
            continue
        y = model[..., c] / step
        below = noise_below([y[here]], [read[..., c][here] / step], 1.0)
        for k in range(_DRAWS):
            begun = rng.uniform(size=(len(y), 1))
            moved = y + below * rng.standard_normal(y.shape)
            drawn[k, ..., c] = np.where(here, step * (y - np.floor(moved + begun)), 0.0) * weight[..., c]
    return drawn if drawn.any() else None


class _Directions(NamedTuple):
    """Whitened `residual` [E, T, ny]; unit `columns` [E T ny, k] of the free parameters; `found` [E T ny, m], unit directions
    of the forces beyond what parameters and initial states do, the places `kept` [m] of these among all forces, their
    `lengths` [m], and what of the free parameters' columns goes with each, `onto` [k, m]."""

    residual: Array
    columns: Array
    found: Array
    kept: NDArray[np.int64]
    lengths: Array
    onto: Array


def without_starts(problem: Problem, columns: Array, local: Array) -> Array:
    """Columns [E, T, ny, *] less what every log's initial states, whose own are `local`, can do of them."""
    E, T, Y, _ = columns.shape
    if not np.asarray(problem.state_free).any():
        return columns
    left = np.empty_like(columns)
    for e in range(E):
        own, of = local[e].reshape(T * Y, -1), columns[e].reshape(T * Y, -1)
        left[e] = (of - own @ np.linalg.lstsq(own, of, rcond=1e-10)[0]).reshape(T, Y, -1)
    return left


def _directions(problem: Problem, n: int, m: int, residual: Array, jacobian: Array) -> _Directions:
    """Directions from sensitivities [E, T, ny, n + m + s] by own parameters, forces and initial states, which are used up."""
    size = np.linalg.norm(jacobian[..., n : n + m].reshape(-1, m), axis=0)
    both = without_starts(problem, jacobian[..., : n + m], jacobian[..., n + m :]).reshape(-1, n + m)
    own, forces = both[:, :n][:, np.asarray(problem.free)], both[:, n:]
    norms = np.linalg.norm(own, axis=0)
    # In place, for these are the largest arrays of a fit to long logs.
    columns = np.divide(own, np.where(norms > 0, norms, 1.0), out=own)
    onto = np.linalg.lstsq(columns, forces, rcond=1e-10)[0]
    forces -= columns @ onto
    lengths = np.linalg.norm(forces, axis=0)
    kept = np.flatnonzero(lengths > _OWN * np.maximum(size, 1e-300))
    onto = onto / np.where(norms > 0, norms, np.inf)[:, None]
    return _Directions(residual, columns, forces[:, kept] / lengths[kept], kept, lengths[kept], onto[:, kept])


def _by_chance(problem: Problem, d: _Directions) -> Array:
    """Covariance [m, m] of what coloured noise does along the directions."""
    k = d.columns.shape[1]
    every = np.concatenate([d.columns, d.found], axis=1)
    inverse = np.zeros((every.shape[1],) * 2)
    inverse[:k, :k] = np.linalg.pinv(d.columns.T @ d.columns, rcond=1e-12)
    shape = (*d.residual.shape, every.shape[1])
    return stationary(d.residual, every.reshape(shape), np.asarray(problem.mask), inverse)[k:, k:]


def _together(scores: Array, covariance: Array, off: float, freedom: float) -> float:
    """p value of all `scores` [m] at once: their squares in units of `covariance` [m, m], whose root `off` may be no chance.

    What a delay or a dead zone does is seldom along one of the directions alone, and then stands out in several by a little.
    """
    size = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    kept = values > _ALIKE * values.max()
    squares = float(np.sum((vectors[:, kept].T @ (scores / size)) ** 2 / values[kept]))
    excess = max(np.sqrt(squares) - off / float(size.min()), 0.0) ** 2
    rank = int(np.count_nonzero(kept))
    return float(f_tail(excess / rank, rank, freedom))


def _likely(scores: Array, covariance: Array, off: float, freedom: float) -> tuple[int, float, float]:
    """Of `scores` [m] that by chance have this `covariance` the one that stands out most, by how many standard deviations, and
    how likely chance brings as much in two looks: at that one, and at all of them."""
    z = np.maximum(np.abs(scores) - off, 0.0) / np.sqrt(np.diag(covariance))
    best = int(np.argmax(z))
    alone = 2.0 * float(student_tail(z[best], freedom)) * len(z)
    p = min(2.0 * min(alone, _together(scores, covariance, off, freedom)), 1.0)
    return best, float(z[best]), p


def _white_without(problem: Problem, d: _Directions, scores: Array) -> bool:
    """Whether the residual is white but for what lies along the direction that it asks for most: then it is that force that
    colours it, and no noise."""
    best = int(np.argmax(np.abs(scores)))
    left = (d.residual.ravel() - d.found[:, best] * scores[best]).reshape(d.residual.shape)
    left = np.where(np.asarray(problem.mask), left, np.nan)
    channels = [[part[:, c] for part in left] for c in range(left.shape[-1]) if np.isfinite(left[..., c]).any()]
    p_values = [whiteness(parts).p_value for parts in channels]
    return bool(p_values) and min(p_values) > COLOURED / len(p_values)


def neglected(
    robot: Robot,
    logs: LogSet,
    structure: Structure,
    problem: Problem,
    unknowns: Unknowns,
    *,
    white: bool,
    error: float,
    colours: Sequence[Colour] = (),
) -> Neglected | None:
    """What the residual at the optimum `unknowns` most plainly asks for, None where that may be chance.

    `robot` has the estimates. `error` is the RMS of the simulation's own error in units of the noise, which may lie along
    any one direction. `colours` are those of noise that a controller feeds back: its innovations are then asked. None for a
    controlled robot. Call under float64.
    """
    if robot.controlled:
        return None
    full, added = probed(robot, logs)
    numbers = {n: np.asarray(float(v)) for n, v in full.parameters.numbers.items() if n not in problem.numbers}
    wider = replace(problem, numbers={**problem.numbers, **numbers})
    wide = structure._replace(robot=full.structure)
    asked = ways_of(robot)
    ways = _on_the_way(structure, problem, unknowns)[..., [way in asked for way in WAYS]]
    residual, jacobian = (np.asarray(x) for x in _look(wide, added, wider, unknowns))
    own = len(structure.names) + len(added)
    jacobian = np.concatenate([jacobian[..., :own], ways, jacobian[..., own:]], axis=-1)
    added = (*added, *asked)
    samples = int(np.count_nonzero(np.asarray(problem.mask)))
    freedom = samples - jacobian.shape[-1]
    if freedom < _FEWEST or not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
        return None
    if colours:
        residual, jacobian = (made_white(colours, x, np.asarray(problem.mask)) for x in (residual, jacobian))
        white = True
    d = _directions(problem, len(structure.names), len(added), residual, jacobian)
    if not d.kept.size:
        return None
    scores = d.found.T @ residual.ravel()
    white = white or _white_without(problem, d, scores)
    covariance = d.found.T @ d.found if white else _by_chance(problem, d)
    # Autocovariances that are cut short may leave a direction less than no variance: of that one nothing is known.
    told = np.flatnonzero(np.diag(covariance) > _ALIKE * np.max(np.diag(covariance)))
    if not told.size:
        return None
    d = d._replace(found=d.found[:, told], kept=d.kept[told], lengths=d.lengths[told], onto=d.onto[:, told])
    scores, covariance = scores[told], covariance[np.ix_(told, told)]
    off = error * float(np.sqrt(samples))
    found = _likely(scores, covariance, off, freedom)
    if found[2] < HINT:
        drawn = _by_rounding(logs, structure, problem, unknowns), _by_coarse_readings(logs, problem, residual)
        every = [own.reshape(_DRAWS, -1) @ d.found for own in drawn if own is not None]
        if every:
            rounding = sum(moved.T @ moved / _DRAWS for moved in every)
            share = float(np.max(np.diag(rounding) / np.diag(covariance + rounding)))
            # Of a variance that few draws tell (Welch and Satterthwaite).
            few = 1.0 / (share**2 / _DRAWS + (1.0 - share) ** 2 / freedom)
            found = _likely(scores, covariance + rounding, off, few)
    best, z, p = found
    if p >= HINT:
        return None
    shift = np.zeros(len(structure.names))
    # The fitted parameters have taken up what they can of the force; in the model, it gives that back.
    shift[np.asarray(problem.free)] = d.onto[:, best] * scores[best] / d.lengths[best]
    return Neglected(words_of(added[d.kept[best]]), z, p, shift)
