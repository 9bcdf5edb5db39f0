"""Weights of the channels: the noise that a fit's own residual shows."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .from_optimum import channel_noise
from .optimum import Optimum
from .problem import Problem, Structure
from .pure import WEIGHT_FLOOR, WEIGHT_ROUNDS, WEIGHT_SETTLED
from .solvers import DEFAULT, Solver, minimise_compiled


def reweighted(
    structure: Structure,
    problem: Problem,
    optimum: Optimum,
    max_steps: int,
    report: Callable[[str], None] = lambda message: None,
    solver: Solver = DEFAULT,
) -> tuple[Problem, Optimum, int]:
    """Estimate every channel's noise from the residual and minimise again, until the weights settle.

    Returns the problem with those weights, its optimum, and the iterations of `optimum` and all that followed.
    """
    floor = np.asarray(problem.sigma) * WEIGHT_FLOOR
    total = int(optimum.iterations)
    for _ in range(WEIGHT_ROUNDS):
        noise = channel_noise(problem, optimum.triangle.squares)
        sigma = np.maximum(np.asarray(noise), floor)
        change = float(np.max(np.abs(sigma / np.asarray(problem.sigma) - 1.0)))
        if change < WEIGHT_SETTLED:
            break
        problem = replace(problem, sigma=np.asarray(sigma))
        optimum = minimise_compiled(structure, problem, optimum.unknowns, max_steps=max_steps, solver=solver)
        total += int(optimum.iterations)
        report("channel noise re-estimated")
    return problem, optimum, total
