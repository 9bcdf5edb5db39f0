"""Models compared under coloured noise: re-estimated by generalised least squares, then held against each other.

Output error weighs every sample alike. Where the noise is coloured, its estimates stray by several of the errors that the
noise allows, and any further parameter that gives them room seems to explain much of the whitened residual, a voltage limit
as well as friction. So each model is first estimated anew from the whitened residuals (Aitken 1935; with an estimated
autoregression: Cochrane & Orcutt, Journal of the American Statistical Association 44, 1949), from where output error ended.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...estimate.noise_colour import Colour
from ...estimate.output_error.estimated_start import estimated_start
from ...logs import LogSet
from ...robots.robot import Robot
from ..left.coloured import whitened
from ..left.heldout import HeldOut, held_out_state, residuals_of
from ..refits.prescribed_angles import predicted
from ..refits.refit import Trial
from ..refits.smoothed_angles import Angles

Array = NDArray[np.float64]

_STEP = 1e-3
"""Step of the secants, in units of a parameter's magnitude."""
_EVALUATIONS = 12
_ENOUGH = 1e-4
"""Share of the sum of squares below which a step is the last."""


def _flat(residuals: Sequence[Array]) -> Array:
    return np.nan_to_num(np.concatenate([r.ravel() for r in residuals]))


def generalised(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float],
    colours: Mapping[str, Colour],
    angles: Angles | None = None,
) -> Robot:
    """The robot with its free parameters estimated from whitened residuals, from its present values; its logs' initial states
    stay what they are for these."""
    table = robot.parameters
    names = list(table.free_names)
    begin = np.array([table[name].value for name in names])
    size = np.array([max(abs(table[n].value), table[n].typical or 0.0, np.finfo(float).tiny) for n in names])
    lower, upper = (np.array([getattr(table[n], side) for n in names]) / size for side in ("lower", "upper"))
    begin = np.clip(begin / size, lower, upper)
    start = estimated_start(robot, logs, noise, angles or {})
    like = held_out_state(robot, logs, noise, angles)

    def white(z: Array) -> Array:
        values = {name: float(v) for name, v in zip(names, z * size, strict=True)}
        found = residuals_of(robot.with_values(**values), logs, like.noise, start, angles)
        return _flat(whitened(replace(like, residuals=tuple(found)), colours).residuals)

    def secants(z: Array) -> Array:
        here, columns = white(z), []
        for i in range(len(z)):
            step = _STEP if z[i] + _STEP <= upper[i] else -_STEP
            moved = z.copy()
            moved[i] += step
            columns.append((white(moved) - here) / step)
        return np.stack(columns, axis=1)

    if not names or like.diverged or np.any(lower >= upper):
        return robot
    options: dict[str, Any] = {"jac": secants, "x_scale": "jac", "ftol": _ENOUGH, "max_nfev": _EVALUATIONS}
    found = scipy.optimize.least_squares(white, begin, bounds=(lower, upper), **options)
    if not found.cost < 0.5 * float(np.sum(white(begin) ** 2)):
        return robot
    return robot.with_values(**{name: float(v) for name, v in zip(names, found.x * size, strict=True)})


def in_colour(
    trial: Trial, colours: Mapping[str, Colour], logs: LogSet, held_out: LogSet, noise: Mapping[str, float]
) -> Trial:
    """The trial estimated anew by generalised least squares, with residuals and chi-squared whitened."""
    robot = generalised(trial.robot, logs, noise, colours, trial.angles)
    fitted: HeldOut = whitened(held_out_state(robot, logs, noise, trial.angles), colours)
    # A model that needs prescribed angles needs them on held-out logs, too.
    left = predicted if trial.angles else held_out_state
    state = trial.held_out if robot is trial.robot else left(robot, held_out, noise)
    again = replace(trial, robot=robot, squares=fitted.squares, fitted=fitted)
    return again.leaving(whitened(state, colours))
