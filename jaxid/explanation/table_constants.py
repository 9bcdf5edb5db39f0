"""Constants of the table that, if they are wrong, do what a named effect does.

A gear ratio, a wheel radius or a supply voltage is taken as known, and no candidate; a wrong one is then named by what looks
the same, such as a sensor's scale. Whether one does is asked of what the effect changed on the held-out logs: do a change of
the constant, and of the fitted parameters with it, change the simulation alike? Those that may are fitted in its place.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..estimate.output_error.estimated_start import estimated_start
from ..logs import LogSet
from ..robots.effect import in_words
from ..robots.robot import Robot
from ..simulation.simulate import simulate_models
from .heldout import scaled_residuals
from .refit import refit
from .search import Step
from .telling_apart import told_apart_from

_STEP = 1e-3
"""Step of secants, in units of a parameter's magnitude."""
_LIKE = 0.5
"""Share of what the effect changed (chi-squared) that a constant may lack to first order to be fitted: large changes bend."""
_MOST = 6
"""Most constants that are fitted."""
Array = NDArray[np.float64]


def _constants(robot: Robot) -> list[str]:
    """The robot's own parameters that are taken as known and are something."""
    own = robot.defaults()
    return [name for name, p in robot.parameters.items() if name in own and not p.free and p.value != 0.0]


def _outputs(models: list[Robot], held_out: LogSet, noise: Mapping[str, float]) -> Array:
    """Simulated outputs of models that differ in their numbers only, in units of the noise [models, samples]."""
    start = estimated_start(models[0], held_out, noise)
    by_log = simulate_models(models, held_out, start=start)
    every = [scaled_residuals(held_out, [y[k] for y in by_log], noise) for k in range(len(models))]
    return np.stack([np.nan_to_num(np.concatenate([r.ravel() for r in own])) for own in every])


def constants_like(step: Step, logs: LogSet, held_out: LogSet) -> dict[str, float]:
    """The constants of the table that explain what the effect added at `step` explains, each fitted in its place, with the
    share of its value by which it then changes; those that do so worse by more than chance are left out."""
    before, after = step.before.robot, step.after.robot
    names, constants = list(before.parameters.free_names), _constants(before)
    if not constants or step.before.angles or step.after.angles:
        return {}
    if step.before.held_out.diverged or step.after.held_out.diverged:
        return {}
    table, noise = before.parameters, step.before.held_out.noise
    sizes = [_STEP * (abs(table[name].value) or table[name].typical or 1.0) for name in (*names, *constants)]
    # Away from an upper bound.
    full = [table[n].value + size > table[n].upper for n, size in zip((*names, *constants), sizes, strict=True)]
    sizes = [-size if over else size for size, over in zip(sizes, full, strict=True)]
    moved = [
        before.change(name, value=table[name].value + size)
        for name, size in zip((*names, *constants), sizes, strict=True)
    ]
    outputs = _outputs([before, *moved], held_out, noise)
    secants, wanted = outputs[1:] - outputs[0], _outputs([after], held_out, noise)[0] - outputs[0]
    likely: list[tuple[float, str]] = []
    own = secants[: len(names)].T
    for k, name in enumerate(constants):
        columns = np.column_stack([own, secants[len(names) + k]])
        if not np.isfinite(columns).all() or not np.any(columns[:, -1]):
            continue
        answer = np.linalg.lstsq(columns, wanted, rcond=1e-9)[0]
        left = float(np.sum((wanted - columns @ answer) ** 2))
        likely += [(left, name)] if left < _LIKE * float(wanted @ wanted) else []
    found: dict[str, float] = {}
    for _, name in sorted(likely)[:_MOST]:
        robot = before.change(name, free=True)
        begin = {own: robot.parameters[own].value for own in robot.parameters.free_names}
        trial = refit(robot, [begin], logs, held_out, noise, step.before.initial_states)
        if not told_apart_from(step.after, trial):
            found[name] = trial.robot.parameters[name].value / table[name].value - 1.0
    return found


def sentence_of(step: Step, logs: LogSet, held_out: LogSet) -> str:
    """A sentence that names those constants; empty where there are none."""
    found = constants_like(step, logs, held_out)
    if not found:
        return ""
    listed = " or ".join(f"{name} ({100 * share:+.2g} %)" for name, share in found.items())
    what = in_words(step.chosen.id)
    return (
        f"What is called {what} here may as well be a wrong constant in the table: {listed} would do the same, as far as these "
        "logs tell. Measure that first, or free it in a model file."
    )
