"""Constants of the table that are wrong, or that would do what a named effect does if they were.

A mass, a gear ratio, a wheel radius or a supply voltage is taken as known; a wrong one, or two, are then named by what looks
the same, such as a sensor's scale. Where no name reaches the noise, few constants are tried in its place (`constants_instead`):
those whose changes, and changes of the fitted parameters with them, leave least of the residual to first order. Where one
does, it is asked whether constants change the simulation like it (`constants_like`).
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects.catalogue import ALL
from ..effects.curve import SHAPE
from ..effects.table_constants import TableConstants
from ..estimate.output_error.estimated_start import estimated_start
from ..logs import LogSet
from ..robots.effect import Effect, in_words
from ..robots.robot import Robot
from ..robots.traits import refusal
from ..simulation.simulate import integrator_for, simulate_models
from .heldout import scaled_residuals
from .refit import Trial, refit_from_itself
from .telling_apart import told_apart_from

_STEP = 1e-3
"""Step of secants, in units of a parameter's magnitude."""
_LIKE = 0.5
"""Share of what the effect changed (chi-squared) that constants may lack to first order to be fitted: large changes bend."""
_BENT = 0.1
"""Share of what another candidate explains that constants may explain less, to first order, and are fitted all the same."""
_MOST = 6
"""Most constants that are fitted one by one."""
_TOGETHER = 3
"""Most constants that are wrong together."""
_FARTHEST = 0.5
"""Share of its value by which nobody's table is wrong."""
_BELIEVABLE = 0.15
"""Share by which a table may be wrong that is not asked for by a name: what is farther off stands in for something else."""
Array = NDArray[np.float64]
Shares = Mapping[str, float]


def _constants(robot: Robot) -> list[str]:
    """The robot's own parameters that are taken as known and are something."""
    own = robot.defaults()
    return [name for name, p in robot.parameters.items() if name in own and not p.free and p.value != 0.0]


def _outputs(models: list[Robot], logs: LogSet, noise: Mapping[str, float]) -> Array:
    """Simulated outputs of models that differ in their numbers only, in units of the noise [models, samples]."""
    start = estimated_start(models[0], logs, noise)
    by_log = simulate_models(models, logs, start=start, integrator=integrator_for(models[0], logs))
    every = [scaled_residuals(logs, [y[k] for y in by_log], noise) for k in range(len(models))]
    return np.stack([np.nan_to_num(np.concatenate([r.ravel() for r in own])) for own in every])


def _left(own: Array, columns: Sequence[Array], wanted: Array) -> float:
    """Share of `wanted` that the changes `own` [n, samples] and `columns` leave, to first order."""
    every = np.column_stack([*own, *columns])
    if not np.isfinite(every).all() or not all(np.any(column) for column in columns):
        return np.inf
    answer = np.linalg.lstsq(every, wanted, rcond=1e-9)[0]
    return float(np.sum((wanted - every @ answer) ** 2)) / max(float(wanted @ wanted), 1e-300)


def _shortened(own: Array, constants: Mapping[str, Array], wanted: Array) -> tuple[Array, dict[str, Array], Array]:
    """The same, turned so that all but the first few samples are zero and left out: what `_left` finds is the same."""
    every = np.column_stack([*own, *constants.values(), wanted])
    if not np.isfinite(every).all():
        return own, dict(constants), wanted
    turned = np.asarray(np.linalg.qr(every, mode="r")).T
    return turned[: len(own)], dict(zip(constants, turned[len(own) : -1], strict=True)), turned[-1]


def _likely(own: Array, constants: Mapping[str, Array], wanted: Array) -> list[tuple[str, ...]]:
    """Which constants, alone and together, may do what is wanted: those alone best first, then ever more of those that
    together do most."""
    own, constants, wanted = _shortened(own, constants, wanted)
    alone = sorted((_left(own, [column], wanted), name) for name, column in constants.items())
    sets: list[tuple[str, ...]] = []
    sets += [(name,) for left, name in alone if left < _LIKE][:_MOST]
    chosen: list[str] = []
    for _ in range(min(_TOGETHER, len(constants))):
        rest = [name for name in constants if name not in chosen]
        left, best = min((_left(own, [constants[n] for n in (*chosen, name)], wanted), name) for name in rest)
        chosen.append(best)
        if len(chosen) > 1 and left < _LIKE:
            sets.append(tuple(chosen))
    return sets


def _secants(before: Trial, after: Sequence[Robot], names: Sequence[str], logs: LogSet) -> tuple[Array, Array, Array]:
    """Residuals of a model on the logs [samples] in units of the noise, their changes with its free parameters and `names`
    [parameters, samples], for small steps each, and those with other models of it, `after` [models, samples]."""
    table = before.robot.parameters
    every = (*table.free_names, *names)
    sizes = [_STEP * (abs(table[name].value) or table[name].typical or 1.0) for name in every]
    # Away from an upper bound.
    full = [table[n].value + size > table[n].upper for n, size in zip(every, sizes, strict=True)]
    sizes = [-size if over else size for size, over in zip(sizes, full, strict=True)]
    moved = [before.robot.change(n, value=table[n].value + size) for n, size in zip(every, sizes, strict=True)]
    noise = before.held_out.noise
    outputs = _outputs([before.robot, *moved], logs, noise)
    others = _outputs([*after], logs, noise) if after else np.empty((0, outputs.shape[1]))
    return outputs[0], outputs[1:] - outputs[0], others - outputs[0]


def constants_like(before: Trial, after: Trial, logs: LogSet, held_out: LogSet) -> list[Shares]:
    """The constants of the table that explain what the last effect of `after` explains of `before`: each set of as few as do,
    fitted in its place, with the shares of their values by which they then change; those that do worse by more than chance,
    or by changes that no table is wrong by, are left out. An effect that is nothing but a constant of the table is that one."""
    meant = _meant(after.effect, before.robot) if after.effect is not None else ()
    if meant:
        shares = changed_by(meant, before.robot, after.robot.parameters)
        return [shares] if max(map(abs, shares.values())) < _FARTHEST else []
    freed = {name for effect in after.robot.effects for name in effect.frees(after.robot)}
    constants = [name for name in _constants(before.robot) if name not in freed]
    if not constants or before.angles or after.angles:
        return []
    if before.fitted.diverged or after.fitted.diverged:
        return []
    _, secants, changes = _secants(before, [after.robot], constants, logs)
    own = secants[: -len(constants)]
    found: list[Shares] = []
    for chosen in _likely(own, dict(zip(constants, secants[-len(constants) :], strict=True)), changes[0]):
        if found and len(chosen) > len(found[0]):
            break  # fewer do
        trial = _with_freed(before, chosen, logs, held_out)
        shares = changed_by(chosen, before.robot, trial.robot.parameters)
        if max(map(abs, shares.values())) < _FARTHEST and not told_apart_from(after, trial):
            found.append(shares)
    return found


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


def constants_instead(before: Trial, best: Trial | None, logs: LogSet, held_out: LogSet) -> Trial | None:
    """`before` with few constants of the table right that explain more than the `best` effect does, by more than chance where
    that is a formula; of ever more of them, the number that the Bayesian criterion prefers. None where there are none."""
    constants = _constants(before.robot)
    if not constants or before.angles or before.fitted.diverged:
        return None
    residual, secants, _ = _secants(before, [], constants, logs)
    own, columns = secants[: -len(constants)], dict(zip(constants, secants[-len(constants) :], strict=True))
    usable = {name: column for name, column in columns.items() if np.isfinite(column).all() and np.any(column)}
    own, usable, residual = _shortened(own, usable, residual)
    rival = best.squares if best is not None else before.squares
    chosen: tuple[str, ...] = ()
    trials: list[Trial] = []
    for _ in range(min(_TOGETHER, len(usable))):
        rest = [name for name in usable if name not in chosen]
        left, name = min((_left(own, [usable[n] for n in (*chosen, name)], -residual), name) for name in rest)
        chosen = (*chosen, name)
        # To first order; what the fit finds may be less.
        if left * float(residual @ residual) > rival + _BENT * (before.squares - rival):
            continue
        trial = _with_freed(before, chosen, logs, held_out)
        shares = changed_by(chosen, before.robot, trial.robot.parameters)
        if max(map(abs, shares.values())) < _BELIEVABLE:
            trials.append(trial)
        if trial.fitted.adequate:
            break
    found = min(trials, key=lambda trial: trial.score, default=None)
    if found is None or best is None:
        return found
    # A curve follows many things; constants that do as well are the simpler answer.
    better = found.score < best.score and (best.law == SHAPE or told_apart_from(found, best))
    return found if better else None


def changed_by(names: Sequence[str], robot: Robot, table: Mapping[str, Any]) -> Shares:
    """By which share of their values in `robot` constants differ in another table (of parameters, or estimates)."""
    return {name: float(table[name].value / robot.parameters[name].value - 1.0) for name in names}


def _with_freed(before: Trial, names: Sequence[str], logs: LogSet, held_out: LogSet) -> Trial:
    """`before` refitted with these constants estimated."""
    robot = before.robot + TableConstants(tuple(names))
    return refit_from_itself(robot, before, logs, held_out, before.held_out.noise)


def in_a_sentence(identifier: str, found: Sequence[Shares]) -> str:
    """A sentence that names those constants, and that they may be meant by the effect `identifier`."""
    listed = " or ".join(" and ".join(f"{n} ({100 * share:+.2g} %)" for n, share in own.items()) for own in found)
    wrong = "a wrong constant" if len(found[0]) == 1 else f"{len(found[0])} wrong constants"
    return (
        f"What is called {in_words(identifier)} here may as well be {wrong} in the table: {listed} would do the same, as far "
        "as these logs tell. Measure that first, or free it in a model file."
    )


def found_wrong(shares: Shares) -> str:
    """A sentence that says which constants of the table the data contradicts, by how much."""
    listed = " and ".join(f"{n} by {100 * share:+.2g} %" for n, share in shares.items())
    return (
        f"No effect of the catalogue but a wrong table explains this best: these logs contradict the value of {listed}. "
        "Measure it, or keep the model as it is now."
    )
