"""What errors of prescribed angles make of the estimates: a fit holds them for true, but they were smoothed from noisy speeds.

What is off in an angle is carried on to the end of its log, where it is largest. So each log's angles are moved by a random
share of their standard deviation, and the model is fitted again.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..._arrays import array
from ...estimate.result import Estimate, Fit
from ..where.missing_force import Smoothed
from .smoothed_angles import Angles

Array = NDArray[np.float64]

_DRAWS, _SEED = 12, 5
"""Draws tell a standard error to a fifth."""


def with_errors_of_angles(
    fit: Fit, ways: Mapping[str, Smoothed], values: Array, refitted: Callable[[Angles], list[float]]
) -> Fit:
    """The fit with what the angles' errors add to the covariance of its free parameters [n].

    `refitted` gives these for other angles, and `values` [n] are those for the angles as they are.
    """
    rng, moved = np.random.default_rng(_SEED), []
    for _ in range(_DRAWS if ways else 0):
        angles = {}
        for name, way in ways.items():
            # Where a log begins is what it is: its ripple's phase counts from there.
            since = np.sqrt(np.maximum(way.std**2 - way.std[:, :1] ** 2, 0.0))
            angles[name] = array(way.mean + rng.standard_normal((len(way.mean), 1)) * since)
        moved.append(np.asarray(refitted(angles)) - values)
    moved = [change for change in moved if np.isfinite(change).all()]
    if not moved:
        return fit
    added = np.mean([np.outer(change, change) for change in moved], axis=0)
    parameters = dict(fit.parameters)
    for name, variance in zip(fit.free_names, np.diag(added), strict=True):
        e = parameters[name]
        parameters[name] = Estimate.of(e.value, float(np.hypot(e.std_error, np.sqrt(variance))), e.unit, e.status)
    return replace(fit, parameters=parameters, covariance=np.asarray(fit.covariance) + added)
