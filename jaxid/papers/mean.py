"""The plain mean of several experiments, as both papers' tables have it."""

from collections.abc import Sequence

import numpy as np

from ..estimate.result import Estimate


def mean_of(estimates: Sequence[Estimate]) -> Estimate:
    """The mean of independent estimates; its standard error takes the estimates as independent.

    It holds nothing of a disagreement between methods. Raises `ValueError` for none, or for different units.
    """
    units = {estimate.unit for estimate in estimates}
    if len(units) != 1:
        raise ValueError(f"The mean of estimates needs one unit, not {sorted(units)}; give estimates of one quantity.")
    value = float(np.mean([estimate.value for estimate in estimates]))
    error = float(np.sqrt(np.sum([estimate.std_error**2 for estimate in estimates]))) / len(estimates)
    return Estimate.of(value, error, units.pop())
