"""Constants of the table that are wrong, or that would do what a named effect does if they were.

A mass, a gear ratio, a wheel radius or a supply voltage is taken as known; a wrong one, or two, are then named by what looks
the same, such as a sensor's scale. Where no name reaches the noise, few constants are tried in its place (`constants_instead`):
those whose changes, and changes of the fitted parameters with them, leave least of the residual to first order. Where one
does, it is asked whether constants change the simulation like it (`constants_like`).
"""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...effects.catalogue import ALL
from ...effects.curve import SHAPE
from ...effects.table_constants import TableConstants
from ...estimate.output_error.estimated_start import estimated_start
from ...logs import LogSet
from ...logs.windows import Windows
from ...robots.effect import Effect
from ...robots.robot import Robot
from ...robots.traits import refusal
from ...simulation.simulate import integrator_for, simulate_models
from ..left.heldout import scaled_residuals
from ..refits.refit import Trial, refit_from_itself
from .telling_apart import told_apart_from

_STEP = 1e-3
"""Step of secants, in units of a parameter's magnitude."""
_LIKE = 0.5
"""Share of what the effect changed (chi-squared) that constants may lack to first order to be fitted: large changes bend."""
_BENT = 0.1
"""Share of what another candidate explains that constants may explain less, to first order, and are fitted all the same."""
_NOTHING = 1e-6
"""Share of a constant's change below which the fitted parameters are taken to do all of it."""
_RANK = 1e-9
"""Share of the largest below which a direction of changes is rounding."""
_MOST = 6
"""Most constants that are fitted one by one."""
_ALIKE = 0.2
"""Share of its size by which what several parts have alike may differ between them."""
_MOST_IN_WINDOWS = 16
"""The same in windows."""
_MOST_SETS = 6
"""Most sets of as many constants, that do as much, which are fitted."""
_AS_MUCH = 0.01
"""Share of what the effect changed that one of these may lack more than another."""
_BLOCK = 25
"""Samples of a stretch that is left out of first looks where a change of one parameter is out of all proportion there."""
_FLIPPED = 100.0
"""That proportion: chi-squared of the change over its median by stretch. A caster that flips a little earlier is no slope."""
_TOGETHER = 3
"""Most constants that are wrong together."""
_FARTHEST = 0.5
"""Share of their values by which no table has several constants wrong."""
_TWICE = 2.2
"""Factor by which no table has one wrong: a diameter for a radius, a half track for a track."""
_NONE = 1e-3
"""Share of its value by which a constant is as good as right: it is not what explains."""
BELIEVABLE = 0.15
"""Share by which a table may be wrong that is not asked for by a name: what is farther off stands in for something else, but
for one constant that leaves nothing."""
Array = NDArray[np.float64]
Shares = Mapping[str, float]


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


def _beyond(own: Array, constants: Mapping[str, Array], wanted: Array) -> tuple[list[str], Array, Array, float]:
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


def _best_of(number: int, directions: Array, left: Array) -> tuple[float, tuple[int, ...]]:
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
    first = np.argsort(-explained)[:_MOST_SETS]
    return [(float(left @ left - explained[best]), tuple(int(k) for k in sets[best])) for best in first]


def _likely(
    own: Array, constants: Mapping[str, Array], wanted: Array
) -> tuple[list[tuple[str, ...]], dict[str, tuple[str, ...]]]:
    """Which constants, alone and together, may do what is wanted: those alone best first, then of ever more of them the sets
    that do most. And of each constant those that do the same as it, beside the fitted parameters."""
    names, directions, left, whole = _beyond(*_steady(own, constants, wanted))
    same = np.abs(directions @ directions.T) > 1.0 - _NOTHING
    twins = {name: tuple(np.array(names)[same[k]].tolist()) for k, name in enumerate(names)}
    alone = sorted(
        (float(left @ left - (d @ left) ** 2) / whole, name) for name, d in zip(names, directions, strict=True)
    )
    sets: list[tuple[str, ...]] = []
    sets += [(name,) for rest, name in alone if rest < _LIKE][:_MOST]
    for number in range(2, min(_TOGETHER, len(names)) + 1):
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


class Wrong(NamedTuple):
    """Constants of the table by the shares of their values that they would be wrong by, and the robot with them right."""

    shares: Shares
    robot: Robot


def constants_like(before: Trial, after: Trial, logs: LogSet, held_out: LogSet) -> list[Wrong]:
    """The constants of the table that explain what the last effect of `after` explains of `before`: each set of as few as do,
    fitted in its place, with the shares of their values by which they then change; those that do worse by more than chance,
    or by changes that no table is wrong by, are left out. An effect that is nothing but a constant of the table is that one,
    or a part of another that the table has none of."""
    meant = _meant(after.effect, before.robot) if after.effect is not None else ()
    if meant:
        shares = changed_by(meant, before.robot, after.robot.parameters)
        itself = [Wrong(shares, after.robot)] if max(map(abs, shares.values())) < _FARTHEST else []
        parts = _none_of(before.robot)
        return itself + [wrong for part in parts for wrong in _as_well(before, after, part, logs, held_out)]
    freed = {name for effect in after.robot.effects for name in effect.frees(after.robot)}
    constants = [name for name in known_constants(before.robot) if name not in freed]
    if not constants or before.fitted.diverged or after.fitted.diverged:
        return []
    if before.angles or after.angles:
        # To first order of whole logs nothing is known there.
        alone = [(name,) for name in constants[:_MOST_IN_WINDOWS]]
        return _as_good(alone if _alike_for_all(after) else [], before, after, logs, held_out)
    _, secants, changes = secants_of(before.robot, before.held_out.noise, [after.robot], constants, logs)
    own = secants[: -len(constants)]
    columns = dict(zip(constants, secants[-len(constants) :], strict=True))
    found: list[Wrong] = []
    while columns and not found:
        sets, twins = _likely(own, columns, changes[0])
        failed: set[str] = set()
        too_far: set[str] = set()
        for chosen in sets:
            if found and len(chosen) > len(found[0].shares):
                break  # fewer do
            if len(chosen) == 1 and chosen[0] in failed:
                continue
            trial = _with_freed(before, chosen, logs, held_out)
            shares = changed_by(chosen, before.robot, trial.robot.parameters)
            if max(map(abs, shares.values())) < _NONE or told_apart_from(after, trial):
                failed |= set(twins[chosen[0]]) if len(chosen) == 1 else set()
            elif not (far := _too_far(shares, before.robot)):
                found.append(Wrong(shares, trial.robot))
            else:
                too_far |= far
        if not too_far:
            break
        # What those would have to be wrong by too much for, others may do by less.
        columns = {name: column for name, column in columns.items() if name not in too_far}
    return found


def constants_as_well(before: Trial, after: Trial, logs: LogSet, held_out: LogSet) -> list[Wrong]:
    """Other sets of as many constants of the table that do what those do by which `after` differs from `before`."""
    own = after.effect.frees(before.robot) if after.effect is not None else ()
    freed = {name for effect in before.robot.effects for name in effect.frees(before.robot)}
    constants = [name for name in known_constants(before.robot) if name not in freed]
    if before.angles or before.fitted.diverged or after.fitted.diverged or not own:
        return []
    if isinstance(logs, Windows):
        sets = [(name,) for name in constants[:_MOST_IN_WINDOWS]] if len(own) == 1 else []
    else:
        _, secants, changes = secants_of(before.robot, before.held_out.noise, [after.robot], constants, logs)
        columns = dict(zip(constants, secants[-len(constants) :], strict=True))
        sets, _ = _likely(secants[: -len(constants)], columns, changes[0])
    others = [names for names in sets if len(names) == len(own) and set(names) != set(own)]
    return _as_good(others, before, after, logs, held_out)[:_MOST_SETS]


def _as_good(
    sets: Sequence[tuple[str, ...]], before: Trial, after: Trial, logs: LogSet, held_out: LogSet
) -> list[Wrong]:
    """Those of the sets of constants that do as well as `after` does, each fitted."""
    found = []
    for chosen in sets:
        trial = _with_freed(before, chosen, logs, held_out)
        shares = changed_by(chosen, before.robot, trial.robot.parameters)
        needed = min(map(abs, shares.values())) > _NONE and not _too_far(shares, before.robot)
        if needed and not told_apart_from(after, trial):
            found.append(Wrong(shares, trial.robot))
    return found


def _alike_for_all(after: Trial) -> bool:
    """Whether the last effect has the same share for each of several parts, as a constant of all of them would make it."""
    effect = after.effect
    names = effect.either_nominal(after.robot) if effect is not None else {}
    shares = [after.robot.parameters[name].value for name in names]
    spread, size = max(shares, default=0.0) - min(shares, default=0.0), abs(sum(shares)) / max(len(shares), 1)
    return len(shares) > 1 and spread < _ALIKE * size


def _none_of(robot: Robot) -> tuple[str, ...]:
    """The constants of the table that are no part of their whole, and might be."""
    return tuple(n for n in robot.parts if robot.parameters[n].value == 0.0 and not robot.parameters[n].free)


def _as_well(before: Trial, after: Trial, constant: str, logs: LogSet, held_out: LogSet) -> list[Wrong]:
    """That constant in the place of the last effect of `after`, where it does what that does."""
    trial = _with_freed(before, (constant,), logs, held_out)
    shares = changed_by((constant,), before.robot, trial.robot.parameters)
    alike = not _too_far(shares, before.robot) and not told_apart_from(after, trial)
    return [Wrong(shares, trial.robot)] if alike else []


def _too_far(shares: Shares, robot: Robot) -> set[str]:
    """Those of the constants of the robot's table that nobody's table has so wrong."""
    least, most = (1.0 / _TWICE - 1.0, _TWICE - 1.0) if len(shares) == 1 else (-_FARTHEST, _FARTHEST)
    parts = _none_of(robot)
    return {
        name for name, share in shares.items() if not (0.0 < share < 1.0 if name in parts else least < share < most)
    }


def _meant(effect: Effect, robot: Robot) -> tuple[str, ...]:
    """The constants of the robot's table that the effect frees, where it does nothing else; none where they are nothing."""
    table, freed = robot.parameters, effect.frees(robot)
    known = all(name in table and not table[name].free and table[name].value != 0.0 for name in freed)
    return tuple(freed) if known and not effect.parameters(robot) else ()


def effects_that_are(constants: Sequence[str], robot: Robot) -> tuple[str, ...]:
    """The ids of the catalogue's effects that are nothing but other values of just these `constants`: one model by two
    names."""
    meant = {effect.id: _meant(effect, robot) for effect in ALL if refusal(effect, robot) is None}
    return tuple(identifier for identifier, names in meant.items() if names and set(names) == set(constants))


def _alone_in_windows(before: Trial, constants: Sequence[str], logs: LogSet, held_out: LogSet) -> list[Trial]:
    """`before` with one of the constants right, each in turn: a window's own initial state takes up a part of what a constant
    does, and first order says little of the rest."""
    fitted = [((name,), _with_freed(before, (name,), logs, held_out)) for name in constants[:_MOST_IN_WINDOWS]]
    return [t for own, t in fitted if not _too_far(changed_by(own, before.robot, t.robot.parameters), before.robot)]


def _together(before: Trial, constants: Sequence[str], rival: float, logs: LogSet, held_out: LogSet) -> list[Trial]:
    """`before` with few of the constants right, ever more of them, as long as they may leave less than `rival`."""
    residual, secants, _ = secants_of(before.robot, before.held_out.noise, [], constants, logs)
    own, columns = secants[: -len(constants)], dict(zip(constants, secants[-len(constants) :], strict=True))
    names, directions, wanted, _ = _beyond(own, columns, -residual)
    trials: list[Trial] = []
    for number in range(1, min(_TOGETHER, len(names)) + 1):
        left, places = _best_of(number, directions, wanted)
        chosen = tuple(names[k] for k in places)
        # To first order; what the fit finds may be less.
        if left > rival + _BENT * (before.squares - rival):
            continue
        trial, chosen = _needed(before, _with_freed(before, chosen, logs, held_out), chosen, logs, held_out)
        shares = changed_by(chosen, before.robot, trial.robot.parameters)
        alone = len(chosen) == 1 and trial.fitted.adequate
        if not (_too_far(shares, before.robot) if alone else max(map(abs, shares.values())) >= BELIEVABLE):
            trials.append(trial)
        if trial.fitted.adequate:
            break
    return trials


def constants_instead(before: Trial, best: Trial | None, logs: LogSet, held_out: LogSet) -> Trial | None:
    """`before` with few constants of the table right that explain more than the `best` effect does, by more than chance where
    that is a formula; of ever more of them, the number that the Bayesian criterion prefers. None where there are none."""
    constants = known_constants(before.robot)
    if not constants or before.angles or before.fitted.diverged:
        return None
    if isinstance(logs, Windows):
        trials = _alone_in_windows(before, constants, logs, held_out)
    else:
        rival = best.squares if best is not None else before.squares
        trials = _together(before, constants, rival, logs, held_out)
    found = min(trials, key=lambda trial: trial.score, default=None)
    if found is None or best is None:
        return found
    # A curve follows many things; constants that do as well are the simpler answer.
    better = found.score < best.score and (best.law == SHAPE or told_apart_from(found, best))
    return found if better else None


def changed_by(names: Sequence[str], robot: Robot, table: Mapping[str, Any]) -> Shares:
    """By which share of their values in `robot` constants differ in another table (of parameters, or estimates); parts of a
    whole that were none of it, by which share of it they are."""
    old = robot.parameters

    def share(name: str) -> float:
        if old[name].value:
            return float(table[name].value / old[name].value - 1.0)
        return float(table[name].value / table[robot.parts[name]].value)

    return {name: share(name) for name in names}


def _with_freed(before: Trial, names: Sequence[str], logs: LogSet, held_out: LogSet) -> Trial:
    """`before` refitted with these constants estimated."""
    robot = before.robot + TableConstants(tuple(names))
    return refit_from_itself(robot, before, logs, held_out, before.held_out.noise)


def _needed(
    before: Trial, trial: Trial, chosen: tuple[str, ...], logs: LogSet, held_out: LogSet
) -> tuple[Trial, tuple[str, ...]]:
    """The trial, with those of the `chosen` constants that it needs, by the Bayesian criterion: sets are chosen to first order,
    and where one of them bends, another may make up for that until it is fitted."""
    if len(chosen) == 1:
        return trial, chosen
    found = trial.robot.parameters
    for name in chosen:
        rest = tuple(own for own in chosen if own != name)
        robot = before.robot + TableConstants(rest)
        robot = robot.with_values(**{own: found[own].value for own in robot.parameters.free_names})
        fewer = refit_from_itself(robot, trial, logs, held_out, before.held_out.noise)
        if fewer.score < trial.score:
            return _needed(before, fewer, rest, logs, held_out)
    return trial, chosen
