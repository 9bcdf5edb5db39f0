"""How much more than white noise what is left adds up to.

Costs and standard errors count samples as independent. Where neighbouring residuals go together, as all that a wrong model
leaves does, chance makes of a cost, and of the square of an estimate's error, as many times more as their long-run variance is.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from .evaluation import simulated
from .problem import Problem, Structure, Unknowns, residual_weights

_BATCHES = 20
"""Stretches of a log whose sums tell the long-run variance."""
_COLOURED = 2.0
"""Long-run variance that is no chance."""


def long_run(residuals: Iterable[NDArray[np.float64]]) -> float:
    """Long-run variance of weighted residuals [T, channels] of logs, zero where nothing was measured (batch means); 1 for white
    noise and for what is near it."""
    squares, samples = 0.0, 0
    for own in residuals:
        seen = own != 0.0
        end = int(np.flatnonzero(seen.any(axis=1)).max(initial=-1)) + 1
        each = max(end // _BATCHES, 1)
        whole = own[: end - end % each]
        squares += float(np.sum(whole.reshape(-1, each, own.shape[1]).sum(axis=1) ** 2))
        samples += int(np.count_nonzero(whole))
    found = squares / max(samples, 1)
    return found if np.isfinite(found) and found > _COLOURED else 1.0


def long_run_at(structure: Structure, problem: Problem, at: Unknowns) -> float:
    """The same of what is left at these unknowns."""
    y, weights = np.asarray(simulated(structure, problem, at)), residual_weights(problem)
    return long_run(np.where(weights > 0.0, y - np.asarray(problem.outputs), 0.0) * weights)
