"""SciPy `least_squares` on the numba simulator.

`dense` is what one writes first: `trf`, the Jacobian by SciPy's own forward differences, 31 simulations of everything
for each. `structured` moves every experiment's initial state at once, 10 simulations. Tolerances are SciPy's defaults
(1e-8 relative on cost, step and gradient); parameters are in units of their published values.
"""

import numpy as np
from scipy.optimize import least_squares

from .pioneer_numba import residual, structured_jacobian
from .pioneer_problem import FitProblem
from .reached import Clock, Reached


def dense(problem: FitProblem, max_linearisations: int = 200) -> Reached:
    """Trust region reflective with dense finite differences."""
    clock = Clock()
    result = least_squares(
        lambda x: residual(problem, x),
        problem.start_point,
        method="trf",
        max_nfev=max_linearisations,
        callback=lambda intermediate_result: clock.note(intermediate_result.cost),
    )
    return Reached(result.x, int(result.njev), result.message, clock.seen)


def structured(problem: FitProblem, max_linearisations: int = 200) -> Reached:
    """Trust region reflective with the 10 finite differences that the problem's structure leaves."""
    clock = Clock()
    result = least_squares(
        lambda x: residual(problem, x),
        problem.start_point,
        jac=lambda x: structured_jacobian(problem, np.asarray(x)),
        method="trf",
        max_nfev=max_linearisations,
        callback=lambda intermediate_result: clock.note(intermediate_result.cost),
    )
    return Reached(result.x, int(result.njev), result.message, clock.seen)
