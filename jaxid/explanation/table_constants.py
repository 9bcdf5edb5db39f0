"""Constants of the table that, if they are wrong, do what a named effect does.

A mass, a gear ratio, a wheel radius or a supply voltage is taken as known, and no candidate; a wrong one, or two, are then
named by what looks the same, such as a sensor's scale. Whether some do is asked of what the effect changed on the fitted
logs: do changes of few constants, and of the fitted parameters with them, change the simulation alike? Those that may are
fitted in its place.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..estimate.output_error.estimated_start import estimated_start
from ..logs import LogSet
from ..robots.effect import in_words
from ..robots.robot import Robot
from ..simulation.simulate import simulate_models
from .heldout import scaled_residuals
from .refit import Trial, refit
from .search import Step
from .telling_apart import told_apart_from

_STEP = 1e-3
"""Step of secants, in units of a parameter's magnitude."""
_LIKE = 0.5
"""Share of what the effect changed (chi-squared) that constants may lack to first order to be fitted: large changes bend."""
_MOST = 6
"""Most constants that are fitted one by one."""
_TOGETHER = 3
"""Most constants that are wrong together."""
_FARTHEST = 0.5
"""Share of its value by which nobody's table is wrong."""
Array = NDArray[np.float64]
Shares = dict[str, float]


def _constants(robot: Robot) -> list[str]:
    """The robot's own parameters that are taken as known and are something."""
    own = robot.defaults()
    return [name for name, p in robot.parameters.items() if name in own and not p.free and p.value != 0.0]


def _outputs(models: list[Robot], logs: LogSet, noise: Mapping[str, float]) -> Array:
    """Simulated outputs of models that differ in their numbers only, in units of the noise [models, samples]."""
    start = estimated_start(models[0], logs, noise)
    by_log = simulate_models(models, logs, start=start)
    every = [scaled_residuals(logs, [y[k] for y in by_log], noise) for k in range(len(models))]
    return np.stack([np.nan_to_num(np.concatenate([r.ravel() for r in own])) for own in every])


def _left(own: Array, columns: Sequence[Array], wanted: Array) -> float:
    """Share of `wanted` that the changes `own` [n, samples] and `columns` leave, to first order."""
    every = np.column_stack([*own, *columns])
    if not np.isfinite(every).all() or not all(np.any(column) for column in columns):
        return np.inf
    answer = np.linalg.lstsq(every, wanted, rcond=1e-9)[0]
    return float(np.sum((wanted - every @ answer) ** 2)) / max(float(wanted @ wanted), 1e-300)


def _likely(own: Array, constants: Mapping[str, Array], wanted: Array) -> list[tuple[str, ...]]:
    """Which constants, alone and together, may do what is wanted: those alone best first, then ever more of those that
    together do most."""
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


def constants_like(step: Step, logs: LogSet, held_out: LogSet) -> list[Shares]:
    """The constants of the table that explain what the effect added at `step` explains: each set of as few as do, fitted in
    its place, with the shares of their values by which they then change; those that do worse by more than chance, or by
    changes that no table is wrong by, are left out."""
    before, after = step.before.robot, step.after.robot
    freed = {name for effect in after.effects for name in effect.frees(after)}
    names = list(before.parameters.free_names)
    constants = [name for name in _constants(before) if name not in freed]
    if not constants or step.before.angles or step.after.angles:
        return []
    if step.before.fitted.diverged or step.after.fitted.diverged:
        return []
    table, noise = before.parameters, step.before.held_out.noise
    sizes = [_STEP * (abs(table[name].value) or table[name].typical or 1.0) for name in (*names, *constants)]
    # Away from an upper bound.
    full = [table[n].value + size > table[n].upper for n, size in zip((*names, *constants), sizes, strict=True)]
    sizes = [-size if over else size for size, over in zip(sizes, full, strict=True)]
    moved = [
        before.change(name, value=table[name].value + size)
        for name, size in zip((*names, *constants), sizes, strict=True)
    ]
    outputs = _outputs([before, *moved], logs, noise)
    secants, wanted = outputs[1:] - outputs[0], _outputs([after], logs, noise)[0] - outputs[0]
    own = secants[: len(names)]
    found: list[Shares] = []
    for chosen in _likely(own, dict(zip(constants, secants[len(names) :], strict=True)), wanted):
        if found and len(chosen) > len(found[0]):
            break  # fewer do
        trial = _with_freed(step.before, chosen, logs, held_out)
        shares = {name: trial.robot.parameters[name].value / table[name].value - 1.0 for name in chosen}
        if max(map(abs, shares.values())) < _FARTHEST and not told_apart_from(step.after, trial):
            found.append(shares)
    return found


def _with_freed(before: Trial, names: Sequence[str], logs: LogSet, held_out: LogSet) -> Trial:
    """`before` refitted with these constants estimated."""
    robot = before.robot
    for name in names:
        robot = robot.change(name, free=True)
    begin = {own: robot.parameters[own].value for own in robot.parameters.free_names}
    return refit(robot, [begin], logs, held_out, before.held_out.noise, before.initial_states)


def in_a_sentence(identifier: str, found: Sequence[Shares]) -> str:
    """A sentence that names those constants, and that they may be meant by the effect `identifier`."""
    listed = " or ".join(" and ".join(f"{n} ({100 * share:+.2g} %)" for n, share in own.items()) for own in found)
    wrong = "a wrong constant" if len(found[0]) == 1 else f"{len(found[0])} wrong constants"
    return (
        f"What is called {in_words(identifier)} here may as well be {wrong} in the table: {listed} would do the same, as far "
        "as these logs tell. Measure that first, or free it in a model file."
    )
