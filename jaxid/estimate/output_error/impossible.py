"""An interval that reaches where there is no robot: a mass of zero, say.

A standard error near the parameter's own size makes an interval that reaches the parameter's bound. For a friction that is an
answer: there may be none. Where the robot cannot be simulated on the bound, the interval says only that these logs do not
tell the parameter.
"""

from dataclasses import replace

import numpy as np

from ..result import NORMAL_95, Fit
from .evaluation import cost_at
from .problem import DIVERGED, Problem, Structure, Unknowns, holding


def without_impossible(fit: Fit, structure: Structure, problem: Problem, unknowns: Unknowns) -> Fit:
    """The fit in which no parameter is identified whose 95 % interval reaches a bound on which the simulation is not
    finite, with a note on each. Call under float64."""
    parameters, notes = dict(fit.parameters), []
    for k, name in enumerate(structure.names):
        estimate, entry = fit[name], fit.robot.parameters[name]
        if estimate.status != "identified":
            continue
        half = NORMAL_95 * estimate.std_error
        for bound, beyond in ((entry.lower, estimate.value - half), (entry.upper, estimate.value + half)):
            reached = np.isfinite(bound) and (bound - beyond) * (bound - estimate.value) <= 0
            if not reached or cost_at(structure, holding(problem, k, bound), unknowns) < DIVERGED:
                continue
            parameters[name] = replace(estimate, status="not_identifiable")
            notes.append(
                f"{name}: its 95 % interval reaches {bound:g} {entry.unit}, where there is no such robot; these logs do not "
                "determine it."
            )
    return replace(fit, parameters=parameters, notes=(*fit.notes, *notes)) if notes else fit
