"""Estimates from readings that are rounded to a sensor's coarse step.

Least squares takes rounding for noise, which it is not where a signal changes slowly: the estimate is biased, and what is left
looks like a dead zone or a friction that is not there. So what rounding makes of the simulation on average is taken out of the
readings, and the parameters are fitted again, a few times over, until average readings fit best.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ..rounding import mean_rounding, noise_below, shows, step_of
from .conclude import simulated_at
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns, parameters_at

_ROUNDS, _SETTLED = 15, 1e-4
"""How often the average rounding is taken anew at most, and the relative change of all parameters at which it is settled."""
_DITHERED = 0.5
"""Noise before rounding, in steps, from which average readings are the signal's to a four hundredth of a step."""


def beyond_rounding(
    structure: Structure,
    problem: Problem,
    optimum: Optimum,
    logs: LogSet,
    minimise: Callable[[Problem, Unknowns], Optimum],
) -> tuple[Problem, Optimum]:
    """The problem with readings without average rounding, in channels in whose residual it is to be seen, and its optimum."""
    there = np.asarray(problem.mask)
    left = np.sqrt(np.asarray(optimum.triangle.squares).sum(axis=0) / np.maximum(there.sum(axis=(0, 1)), 1))
    left = left * np.asarray(problem.sigma)
    steps = [step_of(logs, name) for name in logs.channels.measured]
    seen = [c for c, step in enumerate(steps) if there[..., c].any() and step and shows(step, float(left[c]))]
    counted = [there[e, : len(log)] for e, log in enumerate(logs)]
    read = [np.where(ok, log.outputs, np.nan) for ok, log in zip(counted, logs, strict=True)]
    for turn in range(_ROUNDS if seen else 0):
        outputs = np.array(problem.outputs)
        every = simulated_at(structure, problem, optimum.unknowns, logs)
        if turn == 0:
            seen = [c for c in seen if noise_below(_column(every, c), _column(read, c), steps[c]) < _DITHERED]
        if not seen:
            break
        for c in seen:
            for e, own in enumerate(mean_rounding(_column(every, c), _column(read, c), steps[c])):
                outputs[e, : len(own), c] = np.where(counted[e][:, c], read[e][:, c] - own, outputs[e, : len(own), c])
        problem = replace(problem, outputs=outputs)
        before = np.asarray(parameters_at(problem, optimum.unknowns.z))
        optimum = minimise(problem, optimum.unknowns)
        after = np.asarray(parameters_at(problem, optimum.unknowns.z))
        if np.all(np.abs(after - before) <= _SETTLED * np.abs(after)):
            break
    return problem, optimum


def _column(logs: Sequence[NDArray[np.float64]], c: int) -> list[NDArray[np.float64]]:
    return [log[:, c] for log in logs]
