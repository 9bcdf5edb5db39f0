"""How simulated positions, which an estimate moves as well, move what its equations leave.

Positions that no sensor measures, such as a caster's angle, are the simulation's in `refined_instruments`. Another estimate
simulates other ones, so that the moments Z^T (y - F theta) have a derivative beside that of F theta; an estimate that solves
them scatters by the inverse of the whole derivative (two-step estimators: Newey and McFadden, Handbook of Econometrics 4,
1994, section 6).
"""

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ...robots.robot import Robot
from .linear_steps import with_estimate
from .log_rows import positions_of
from .refined_instruments import Instruments, refined_instruments
from .simulated_motion import followed_simulation

Array = NDArray[np.float64]
_STEP, _LEAST = 0.5, 1e-3
"""Standard errors over which the derivative is taken (the estimate's own scatter: a motion with kinks has a mean slope), half
the value at most, and where that is next to nothing this share of the error."""


def whole_slopes(
    robot: Robot, logs: LogSet, speeds: tuple[str, ...], theta: Array, errors: Array, found: Instruments
) -> Array:
    """Minus the derivative [K, n] of the equations' errors by the free parameters, simulated positions included.

    Those of the regressors alone where a parameter has no standard error in `errors` [n], and where a step of half of one
    changes which intervals there are.
    """
    slopes, names = found.regressors.copy(), robot.parameters.free_names
    if not positions_of(robot, speeds):
        return slopes
    here = found.targets - found.regressors @ theta
    for i, name in enumerate(names):
        if not (np.isfinite(errors[i]) and errors[i] > 0):
            continue
        step = _STEP * min(errors[i], max(abs(theta[i]), _LEAST * errors[i]))
        if theta[i] + step > robot.parameters[name].upper:
            step = -step
        at = theta.copy()
        at[i] += step
        moved = with_estimate(robot, names, at)
        simulated = followed_simulation(moved, logs)
        if simulated is None:
            continue
        there = refined_instruments(moved, list(logs), simulated, speeds, at, found)
        if np.array_equal(there.run, found.run) and np.array_equal(there.sample, found.sample):
            slopes[:, i] = (here - there.targets + there.regressors @ at) / step
    return slopes
