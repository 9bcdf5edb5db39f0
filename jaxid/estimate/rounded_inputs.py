"""Inputs that were rounded before they were logged.

A duty in 1/255, a voltage with four decimals: what acted lies anywhere within half a step, for as long as the logged number
stays the same. That is no noise: it moves the simulation for many samples in one direction, and a position for ever.
"""

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ..logs import LogSet
from ..logs.noise import sensor_step

_LEVELS = 48
"""Different values from which an input was rounded to its step; fewer are what was commanded, as it was."""
_DECIMALS = 6
_WHOLE = 1e-6
"""How far from a whole number of the last decimals a number may be that was written with so many."""


def input_step(logs: LogSet, name: str) -> float:
    """The step [the input's unit] to which an input was rounded before it was logged; zero where it was not."""
    values = np.concatenate([log.input(name) for log in logs])
    step = sensor_step(values)
    return step if step and len(np.unique(np.round(values / step))) >= _LEVELS else 0.0


def written_step(logs: LogSet, name: str) -> float:
    """The same, or one of the last decimal with which all of its numbers were written, as long as these are few."""
    step = input_step(logs, name)
    values = np.unique(np.concatenate([log.input(name) for log in logs]))
    values = values[np.isfinite(values)]
    if step or len(values) < _LEVELS:
        return step
    for decimals in range(_DECIMALS + 1):
        scaled = values * 10.0**decimals
        if np.all(np.abs(scaled - np.round(scaled)) < _WHOLE):
            return 10.0**-decimals
    return 0.0


def as_they_may_have_been(
    inputs: Float[NDArray[np.float64], "T nu"], steps: list[float], rng: np.random.Generator
) -> Float[NDArray[np.float64], "T nu"]:
    """Inputs that rounding to the steps makes these of, off by as much for as long as they stay the same; what is zero is."""
    found = np.array(inputs, float)
    for i, step in enumerate(steps):
        changed = np.append(True, np.diff(found[:, i]) != 0)
        off = rng.uniform(-0.5, 0.5, changed.sum())[np.cumsum(changed) - 1]
        found[:, i] += np.where(found[:, i] != 0, off * step, 0.0)
    return found
