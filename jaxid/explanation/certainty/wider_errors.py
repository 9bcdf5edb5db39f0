"""Standard errors that allow for another model of which the data does not tell whether it is the right one."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from ...estimate.result import Estimate, Fit
from ...estimate.uncertainty import PRACTICAL


def reaching_to(final: Fit, others: Mapping[str, tuple[float, float]]) -> Fit:
    """`final` with standard errors of parameters that reach to what they are in another model: by parameter how far that is
    and what its standard error is there. None becomes smaller, and what is larger than the parameter no longer tells it."""
    wider = {name: max(float(np.hypot(error, by)) / final[name].std_error, 1.0) for name, (by, error) in others.items()}
    estimates = {
        n: _widened(e, wider[n], final.robot.parameters[n].typical or 0.0) if n in wider else e
        for n, e in final.parameters.items()
    }
    scale = np.array([wider.get(name, 1.0) for name in final.free_names])
    return replace(final, parameters=estimates, covariance=final.covariance * np.outer(scale, scale))


def _widened(estimate: Estimate, by: float, typical: float) -> Estimate:
    error = estimate.std_error * by
    told = estimate.status in ("identified", "at_bound")
    lost = by > 1.0 and told and error > PRACTICAL * max(abs(estimate.value), typical)
    return Estimate.of(estimate.value, error, estimate.unit, "not_identifiable" if lost else estimate.status)


def not_told(final: Fit, names: Iterable[str]) -> Fit:
    """`final` in which the named parameters, which another model does not tell, are not identified either."""
    table, estimates = final.robot.parameters, dict(final.parameters)
    for name in names:
        limits = (table[name].lower, table[name].upper)
        estimates[name] = replace(estimates[name], status="not_identifiable", std_error=float("inf"), ci95=limits)
    return replace(final, parameters=estimates)
