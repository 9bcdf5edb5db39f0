"""Priors that contradict the logs.

Of a Gaussian prior and Gaussian data that agree, the estimate with both lies from the prior's mean by no more than chance: its
difference from it has the prior's variance less the estimate's own (as Hausman's of an efficient estimate, Econometrica 46,
1978). Where it lies farther off, prior or model is wrong, and the standard error, which counts on both, holds neither.
"""

import numpy as np

from ..parameters import ParameterTable
from .result import Estimate

_APART = 3.5
"""Standard errors from which the two contradict each other: a prior that is right is said to be wrong in one fit of 2,000."""
_LEAST = 1e-4
"""Share of the prior's variance, at least, that the data takes off: less is lost in rounding."""


def prior_conflicts(table: ParameterTable, found: dict[str, Estimate]) -> str:
    """A sentence on each prior of `table` that contradicts what the estimates `found` say; empty where none does."""
    sentences = []
    for name, estimate in found.items():
        prior = table[name].prior if name in table else None
        if prior is None or estimate.status != "identified" or not np.isfinite(estimate.std_error):
            continue
        mean, spread = prior
        told = max(1.0 - (estimate.std_error / spread) ** 2, _LEAST)
        apart = abs(estimate.value - mean) / (spread * np.sqrt(told))
        if not apart > _APART:
            continue
        # What the logs alone say: the prior's precision taken off the estimate's.
        alone, error = mean + (estimate.value - mean) / told, spread * np.sqrt((1.0 - told) / told)
        unit = f" {estimate.unit}" if estimate.unit else ""
        sentences.append(
            f"The prior of {name} ({mean:.6g} ± {spread:.2g}{unit}) contradicts the logs, which alone would say about "
            f"{alone:.5g} ± {error:.2g}{unit} with this model: prior or model is wrong, and the estimate between them, "
            f"{estimate.value:.5g}{unit}, is of neither. Leave the prior out or widen it."
        )
    return " ".join(sentences)
