"""Logs that the model explains one by one and not together: something changed between them.

A payload in some of the logs, another battery or another floor is no effect of the robot's: within each log the model lacks
nothing, and its parameters differ from log to log.
"""

from collections.abc import Callable

import numpy as np

from ..._distributions import chi_squared_tail
from ...estimate.output_error.fleet import fit_fleet
from ...estimate.result import Estimate, Fit
from ...logs import LogSet
from ..level import current_level
from .odd_logs import unlike_the_others

_FEWEST, _MOST = 3, 40
"""Logs below which nobody can say which one is another, and beyond which it would take too long."""
_AWAY = 5.0
"""Standard errors from the middle of all logs beyond which a log's own value is told."""
_TOLD = 4


def changed_between(fit: Fit, logs: LogSet, held_out: LogSet, report: Callable[[str], None]) -> str:
    """A sentence on which parameter differs between which logs where the model of `fit` explains every log alone and not all of
    them together, or on logs that it does not explain where it explains all others; empty where it does neither, or where no
    parameter that they tell differs by more than chance."""
    every = [*logs, *held_out]
    if fit.window is not None or not _FEWEST <= len(every) <= _MOST:
        return ""
    report("looking whether every log alone is explained")
    start = {name: fit.robot.parameters[name].value for name in fit.free_names}
    alone = fit_fleet(fit.robot, {log.name: LogSet([log]) for log in every}, start=start)
    odd = [log.name for log in every if log.name in alone.failed or not alone.fits[log.name].sound]
    if odd:
        return unlike_the_others(fit, logs, held_out, odd)
    surest, name = current_level() / max(len(fit.free_names), 1), ""
    differing: dict[str, Estimate] = {}
    for candidate in fit.free_names:
        told = {log: own[candidate] for log, own in alone.fits.items() if own[candidate].status == "identified"}
        values, errors = (np.array([getattr(e, what) for e in told.values()]) for what in ("value", "std_error"))
        if len(told) < _FEWEST or not (np.isfinite(errors).all() and np.all(errors > 0)):
            continue
        mean = np.average(values, weights=errors**-2)
        p = float(chi_squared_tail(float(np.sum(((values - mean) / errors) ** 2)), len(told) - 1))
        if p < surest:
            surest, name, differing = p, candidate, told
    if not differing:
        return ""
    middle = float(np.median([e.value for e in differing.values()]))
    away = {log: e for log, e in differing.items() if abs(e.value - middle) > _AWAY * e.std_error}
    furthest = sorted(away, key=lambda log: -abs(away[log].value - middle) / away[log].std_error)
    if not furthest:
        return ""
    unit = f" {fit[name].unit}".rstrip()
    each = [f"{away[log].value:.4g} ± {away[log].std_error:.1g}{unit} in {log}" for log in furthest[:_TOLD]]
    more = f" (and {len(furthest) - _TOLD} more)" if len(furthest) > _TOLD else ""
    return (
        f"Every log alone is explained by the robot as it is, with values of its own: {name} is {', '.join(each)}{more}, "
        f"where the middle of all logs is {middle:.4g}{unit}. Then something changed between the logs (a load, the battery, "
        "the floor), and within each nothing is missing: `explain_change` says what, between the logs before it and after it."
    )
