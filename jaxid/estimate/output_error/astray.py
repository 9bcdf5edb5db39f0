"""A log on which the simulation went the other way holds all parameters where it does so.

A caster that swings round on the other side in a reversal, or an axis that just breaks away, is a step of the cost: beyond it
lies another minimum, to which the other logs would lead. So the log that stands out is left out for a while.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from .optimum import Optimum
from .problem import Problem, Unknowns

_SURE = 5.0
"""Standard deviations of a white residual's size above which a log's is no chance."""
_STANDS_OUT = 1.05
"""Ratio of a log's residual to the middle one's above which it stands out."""
_FEWEST, _MOST = 3, 2
"""Logs from which one can stand out, and how many are left out, one after another."""
_LOWER = 1.0
"""Half chi-squared by which the cost has to fall for another minimum to be one."""


def without(problem: Problem, logs: Sequence[int]) -> Problem:
    """The problem in which the logs of these numbers have no weight."""
    kept = np.ones(problem.mask.shape[0], dtype=bool)
    kept[list(logs)] = False
    return replace(problem, mask=np.asarray(np.asarray(problem.mask) & kept[:, None, None]))


def stands_out(problem: Problem, optimum: Optimum, others: float = np.inf) -> int | None:
    """The number of the log whose residual stands out among all, in units of the noise; None where none does, or where the
    middle one's is above `others`, too."""
    counted = np.asarray(problem.mask).sum(axis=(1, 2))
    there = np.flatnonzero(counted)
    if len(there) < _FEWEST:
        return None
    squares = np.asarray(optimum.triangle.squares).sum(axis=1)[there]
    left = np.sqrt(squares / counted[there])
    worst = int(np.argmax(left))
    # From the others, and not from the noise that neighbouring samples show, which rounding overrates.
    middle, chance = float(np.median(left)), 1.0 + _SURE / np.sqrt(2.0 * counted[there][worst])
    if not left[worst] > max(chance, _STANDS_OUT) * middle or middle > others:
        return None
    return int(there[worst])


def past_the_astray(
    problem: Problem, optimum: Optimum, minimise: Callable[[Problem, Unknowns], Optimum], others: float = np.inf
) -> Optimum:
    """The minimum that is found where the log that stands out is left out and comes back, or `optimum` where that is no lower.
    `minimise` solves a problem from given unknowns; `others` is as in `stands_out`."""
    for _ in range(_MOST):
        log = stands_out(problem, optimum, others)
        if log is None:
            break
        away = minimise(without(problem, [log]), optimum.unknowns)
        if not np.isfinite(away.cost) or bool(away.diverged):
            break
        states = np.array(away.unknowns.states)
        states[log] = np.asarray(optimum.unknowns.states)[log]  # which nothing held
        again = minimise(problem, away.unknowns._replace(states=states))
        if not np.isfinite(again.cost) or bool(again.diverged) or not again.cost < optimum.cost - _LOWER:
            break
        optimum = again
    return optimum
