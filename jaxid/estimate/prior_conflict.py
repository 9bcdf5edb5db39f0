"""Priors that contradict the logs.

Of a Gaussian prior and Gaussian data that agree, the estimate with both lies from the prior's mean by no more than chance: its
difference from it has the prior's variance less the estimate's own (as Hausman's of an efficient estimate, Econometrica 46,
1978). Where it lies farther off, prior or model is wrong, and the standard error, which counts on both, holds neither.
"""

from collections.abc import Mapping

import numpy as np

from ..parameters import ParameterTable
from .result import Estimate

_APART = 3.5
"""Standard errors from which the two contradict each other: a prior that is right is said to be wrong in one fit of 2,000."""
_LEAST = 0.01
"""Share of the prior's variance, at least, that the data takes off: less is hardly a word against the prior, and whatever else
moves the estimate, such as another parameter's bound, would count a hundredfold."""


def prior_conflicts(
    table: ParameterTable, found: Mapping[str, Estimate], white: Mapping[str, float] | None = None
) -> str:
    """A sentence on each prior of `table` that contradicts what the estimates `found` say; empty where none does.

    `white`: the standard errors that the residual would have if it were white, by which the estimates weigh prior and data;
    where they are not known, only what no weight could explain is said.
    """
    sentences = []
    for name, estimate in found.items():
        prior = table[name].prior if name in table else None
        if prior is None or estimate.status != "identified" or not np.isfinite(estimate.std_error):
            continue
        mean, spread = prior
        scatter, error, weight = spread**2 + estimate.std_error**2, float("nan"), float("nan")
        if white is not None and name in white:
            # The weight that the data has, and what it would say with all of it.
            weight = 1.0 - (white[name] / spread) ** 2
            if weight < _LEAST:
                continue
            own = max(estimate.std_error, white[name]) ** 2 - (1.0 - weight) * white[name] ** 2
            scatter, error = weight**2 * spread**2 + own, np.sqrt(own) / weight
        if not abs(estimate.value - mean) > _APART * np.sqrt(scatter):
            continue
        unit = f" {estimate.unit}" if estimate.unit else ""
        alone = "the logs"
        if np.isfinite(error):
            alone += f", which alone say about {mean + (estimate.value - mean) / weight:.5g} ± {error:.2g}{unit}"
        sentences.append(
            f"The prior of {name} ({mean:.6g} ± {spread:.2g}{unit}) contradicts {alone}: it or the model is wrong, and "
            f"{estimate.value:.5g}{unit}, between the two, is neither's answer. Leave the prior out, or widen it."
        )
    return " ".join(sentences)
