"""What constants of the table would do to a simulation to first order, and which sets of them may do what is wanted.

A few constants, alone or together, are worth a fit where their changes, and changes of the fitted parameters with them, do
most of it (`likely`, `best_of`).
"""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...estimate.output_error.estimated_start import estimated_start
from ...logs import LogSet
from ...robots.robot import Robot
from ...simulation.simulate import integrator_for, simulate_models
from ..left.heldout import scaled_residuals

_STEP = 1e-3
"""Step of secants, in units of a parameter's magnitude."""
_LIKE = 0.5
"""Share of what the effect changed (chi-squared) that constants may lack to first order to be fitted: large changes bend."""
_NOTHING = 1e-6
"""Share of a constant's change below which the fitted parameters are taken to do all of it."""
_RANK = 1e-9
"""Share of the largest below which a direction of changes is rounding."""
_MOST = 6
"""Most constants that are fitted one by one."""
MOST_SETS = 6
"""Most sets of as many constants, that do as much, which are fitted."""
_AS_MUCH = 0.01
"""Share of what the effect changed that one of these may lack more than another."""
_BLOCK = 25
"""Samples of a stretch that is left out of first looks where a change of one parameter is out of all proportion there."""
_FLIPPED = 100.0
"""That proportion: chi-squared of the change over its median by stretch. A caster that flips a little earlier is no slope."""
TOGETHER = 3
"""Most constants that are wrong together."""
Array = NDArray[np.float64]


def known_constants(robot: Robot) -> list[str]:
    """The robot's own parameters that are taken as known and are something, or a part of something."""
    own = robot.defaults()
    return [
        name
        for name, p in robot.parameters.items()
        if name in own and not p.free and (p.value != 0.0 or name in robot.parts)
    ]


def measure(name: str, robot: Robot) -> float:
    """What changes of a constant are shares of: its own value, or the whole's that it is none of so far."""
    table = robot.parameters
    return table[name].value or table[robot.parts[name]].value


def _outputs(models: list[Robot], logs: LogSet, noise: Mapping[str, float]) -> Array:
    """Simulated outputs of models that differ in their numbers only, in units of the noise [models, samples]."""
    start = estimated_start(models[0], logs, noise)
    by_log = simulate_models(models, logs, start=start, integrator=integrator_for(models[0], logs))
    every = [scaled_residuals(logs, [y[k] for y in by_log], noise) for k in range(len(models))]
    return np.stack([np.nan_to_num(np.concatenate([r.ravel() for r in own])) for own in every])


def _shortened(own: Array, constants: Mapping[str, Array], wanted: Array) -> tuple[Array, dict[str, Array], Array]:
    """The same, turned so that all but the first few samples are zero and left out: lengths and angles are the same."""
    every = np.column_stack([*own, *constants.values(), wanted])
    if not np.isfinite(every).all():
        return own, dict(constants), wanted
    turned = np.asarray(np.linalg.qr(every, mode="r")).T
    return turned[: len(own)], dict(zip(constants, turned[len(own) : -1], strict=True)), turned[-1]


def beyond(own: Array, constants: Mapping[str, Array], wanted: Array) -> tuple[list[str], Array, Array, float]:
    """Which constants change something, their directions [constants, samples] of length one with the changes `own`
    [n, samples] projected off, what of `wanted` these leave, and the whole of it (chi-squared)."""
    own, columns, wanted = _shortened(own, constants, wanted)
    basis = _basis(own)
    kept = {}
    for name, column in columns.items():
        size = float(np.linalg.norm(column))
        if not np.isfinite(size) or size == 0.0:
            continue
        beyond = column - basis @ (basis.T @ column)
        length = float(np.linalg.norm(beyond))
        if length > _NOTHING * size:  # else the fitted parameters do all that it does
            kept[name] = beyond / length
    left = wanted - basis @ (basis.T @ wanted)
    directions = np.array(list(kept.values())) if kept else np.empty((0, len(wanted)))
    return list(kept), directions, left, max(float(wanted @ wanted), 1e-300)


def _basis(own: Array) -> Array:
    """An orthonormal basis [samples, m] of the changes `own` [n, samples]."""
    finite = own[np.isfinite(own).all(axis=1)]
    sizes = np.linalg.norm(finite, axis=1, keepdims=True)
    turned, values, _ = np.linalg.svd((finite[sizes[:, 0] > 0] / sizes[sizes > 0][:, None]).T, full_matrices=False)
    return turned[:, values > _RANK * values.max(initial=0.0)]


def _steady(own: Array, columns: Mapping[str, Array], wanted: Array) -> tuple[Array, dict[str, Array], Array]:
    """The same without the stretches in which one of the changes is out of all proportion to its size elsewhere; all of them
    where that would leave less than half."""
    every = np.array([*own, *columns.values()])
    count = max(len(wanted) // _BLOCK, 1)
    places = np.array_split(np.arange(len(wanted)), count)
    sizes = np.stack([np.sum(np.nan_to_num(every[:, place]) ** 2, axis=1) for place in places], axis=1)
    usual = np.array([np.median(row[row > 0]) if np.any(row > 0) else np.inf for row in sizes])
    kept = np.all(sizes <= _FLIPPED * usual[:, None], axis=0)
    if kept.all() or 2 * kept.sum() < count:
        return own, dict(columns), wanted
    there = np.concatenate([place for place, fine in zip(places, kept, strict=True) if fine])
    return own[:, there], {name: column[there] for name, column in columns.items()}, wanted[there]


def best_of(number: int, directions: Array, left: Array) -> tuple[float, tuple[int, ...]]:
    """Of all sets of so many `directions` [constants, samples] that which leaves least of `left`, and what it leaves: chosen
    one by one, the first would stand for two that are meant."""
    return _best_sets(number, directions, left)[0]


def _best_sets(number: int, directions: Array, left: Array) -> list[tuple[float, tuple[int, ...]]]:
    """The sets of so many `directions` [constants, samples], and what they leave of `left`, least first; a few of them."""
    sets = np.array(list(combinations(range(len(directions)), number)))
    products, along = directions @ directions.T, directions @ left
    own = products[sets[:, :, None], sets[:, None, :]]
    wanted = along[sets]
    inverse = np.linalg.pinv(own, rcond=_RANK, hermitian=True)
    explained = np.einsum("sa,sab,sb->s", wanted, inverse, wanted)
    first = np.argsort(-explained)[:MOST_SETS]
    return [(float(left @ left - explained[best]), tuple(int(k) for k in sets[best])) for best in first]


def likely(
    own: Array, constants: Mapping[str, Array], wanted: Array
) -> tuple[list[tuple[str, ...]], dict[str, tuple[str, ...]]]:
    """Which constants, alone and together, may do what is wanted: those alone best first, then of ever more of them the sets
    that do most. And of each constant those that do the same as it, beside the fitted parameters."""
    names, directions, left, whole = beyond(*_steady(own, constants, wanted))
    same = np.abs(directions @ directions.T) > 1.0 - _NOTHING
    twins = {name: tuple(np.array(names)[same[k]].tolist()) for k, name in enumerate(names)}
    alone = sorted(
        (float(left @ left - (d @ left) ** 2) / whole, name) for name, d in zip(names, directions, strict=True)
    )
    sets: list[tuple[str, ...]] = []
    sets += [(name,) for rest, name in alone if rest < _LIKE][:_MOST]
    for number in range(2, min(TOGETHER, len(names)) + 1):
        best = _best_sets(number, directions, left)
        most = min(_LIKE, best[0][0] / whole + _AS_MUCH)
        sets += [tuple(names[k] for k in places) for rest, places in best if rest / whole < most]
    return sets, twins


def small_steps(robot: Robot, names: Sequence[str], share: float = _STEP) -> dict[str, float]:
    """Steps of the free parameters and of the constants `names`, a small `share` of what each is, away from an upper bound."""
    table, found = robot.parameters, {}
    for name in (*table.free_names, *names):
        magnitude = measure(name, robot) if name in names else table[name].value
        size = share * (abs(magnitude) or table[name].typical or 1.0)
        found[name] = -size if table[name].value + size > table[name].upper else size
    return found


def secants_of(
    robot: Robot,
    noise: Mapping[str, float],
    after: Sequence[Robot],
    names: Sequence[str],
    logs: LogSet,
    share: float = _STEP,
) -> tuple[Array, Array, Array]:
    """Residuals of a model on the logs [samples] in units of the noise, their changes with its free parameters and `names`
    [parameters, samples], for a small `share` of each, and those with other models of it, `after` [models, samples]."""
    table, steps = robot.parameters, small_steps(robot, names, share)
    moved = [robot.change(n, value=table[n].value + size) for n, size in steps.items()]
    outputs = _outputs([robot, *moved], logs, noise)
    others = _outputs([*after], logs, noise) if after else np.empty((0, outputs.shape[1]))
    return outputs[0], outputs[1:] - outputs[0], others - outputs[0]
