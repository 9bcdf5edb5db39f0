"""Output error in windows: what is known of the initial states of each before anything is fitted."""

from dataclasses import replace

import numpy as np

from ...logs import LogSet
from ...logs.noise import noise_scale
from .problem import Problem, Structure

_WIDE = 100.0
"""Prior standard deviation of a window's initial states in units of the state's own spread: none to speak of."""


def started(whole: LogSet, structure: Structure, problem: Problem) -> Problem:
    """`problem`, of windows of the `whole` logs, with the scale of each initial state that its spread along the logs gives, and
    the noise that they show."""
    scales, precision = np.array(problem.state_scale), np.array(problem.state_precision)
    for i, name in enumerate(structure.state_names):
        if name in problem.start:
            spread = float(np.std(np.asarray(problem.start[name])))
            scales[i] = spread if spread > 0 else scales[i]
            precision[i] = (_WIDE * scales[i]) ** -2
    noise = noise_scale(whole)
    return replace(
        problem,
        sigma=np.asarray([noise[name] for name in whole.channels.measured]),
        state_scale=np.asarray(scales),
        state_precision=np.asarray(precision),
    )
