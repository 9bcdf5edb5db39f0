"""How large parameters are, by the data where they are zero."""

import numpy as np
from numpy.typing import NDArray

from .problem import Problem, Triangle


def effects(problem: Problem, triangle: Triangle) -> NDArray[np.float64]:
    """Length [n] of each parameter's column of the Jacobian: change of the simulation, in units of the noise, per unit of
    the parameter."""
    n = triangle.residual_shared.shape[0]
    columns = np.concatenate([np.asarray(triangle.shared), np.asarray(triangle.crossed).reshape(-1, n)])
    return np.linalg.norm(columns, axis=0) / np.asarray(problem.bounds.scale)


def matter_at(problem: Problem, triangle: Triangle) -> NDArray[np.float64]:
    """Values [n] at which parameters, each alone, would change the simulation by as much as there is to simulate; zero for
    those without effect."""
    found = effects(problem, triangle)
    signal = np.where(np.asarray(problem.mask), np.asarray(problem.outputs) / np.asarray(problem.sigma), 0.0)
    return np.linalg.norm(signal) / np.where(found > 0, found, np.inf)


def magnitudes(problem: Problem, triangle: Triangle, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orders of magnitude [n] of parameters: of their values, or of what would matter where those are zero."""
    alone = matter_at(problem, triangle)
    return np.where(values != 0, np.abs(values), np.where(alone > 0, alone, np.asarray(problem.bounds.scale)))
