"""Bounds that contradict the logs.

Of a parameter on its bound the linearised problem says where its estimate would be without one. Many standard errors beyond,
bound or model is wrong, and every other number makes up for it: what its standard error, which counts on both, cannot show.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..result import Fit
from .bounds import Bounds
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns
from .robust_covariance import robust_covariance

_BEYOND = 3.5
"""Standard errors from which the two contradict each other: a bound that is right is said to be wrong in one fit of 2,000."""


def bound_conflicts(fit: Fit, structure: Structure, problem: Problem, optimum: Optimum) -> dict[str, str]:
    """A sentence on each of the robot's own parameters whose bound contradicts the logs. Call under float64.

    `fit` at the `optimum` of `problem` with every parameter free.
    """
    names = structure.names
    on_it = [i for i, name in enumerate(names) if fit[name].status == "at_bound"]
    own = [i for i in on_it if "." not in names[i]]
    if not own:
        return {}
    without, there, step = _unbounded(problem, optimum, [i for i in on_it if i not in own])
    white = np.linalg.norm(np.linalg.pinv(_shared(problem, optimum)), axis=1)
    if not np.isfinite(step).all() or not np.any(np.abs(step[own]) > _BEYOND * white[own]):
        return {}
    # What is left at the bound follows the motion for the bound's sake, and widens every interval that is made for its colour.
    errors = np.sqrt(np.diag(robust_covariance(structure, without, there).covariance))
    sentences = {}
    for i in own:
        estimate, unit = fit[names[i]], f" {fit[names[i]].unit}" if fit[names[i]].unit else ""
        if not abs(step[i]) > _BEYOND * errors[i] > 0.0:
            continue
        says = f"without it say about {estimate.value + step[i]:.5g} ± {errors[i]:.2g}{unit}"
        remedy = "Move the bound, or look for what is missing."
        if estimate.value == 0.0:  # no negative friction, mass or time is anything
            remedy = "Look for what is missing."
        sentences[names[i]] = (
            f"The bound of {names[i]} ({estimate.value:.6g}{unit}) contradicts the logs, which {says}: it or the model is "
            f"wrong, and what is estimated beside it makes up for that. {remedy}"
        )
    return sentences


def _shared(problem: Problem, optimum: Optimum) -> NDArray[np.float64]:
    return np.asarray(optimum.triangle.shared) / np.asarray(problem.bounds.slope(optimum.unknowns.z))


def _unbounded(
    problem: Problem, optimum: Optimum, held: Sequence[int]
) -> tuple[Problem, Unknowns, NDArray[np.float64]]:
    """The problem without bounds but for the parameters that are `held`, its estimate by one step from the optimum, and that
    step [n] of the parameters."""
    R, at, bounds = optimum.triangle, optimum.unknowns, problem.bounds
    free = [i for i in range(len(np.asarray(at.z))) if i not in held]
    step = np.zeros(len(np.asarray(at.z)))
    reduced = _shared(problem, optimum)[:, free]
    if not np.isfinite(reduced).all():
        return problem, at, np.full_like(step, np.nan)
    step[free] = -np.linalg.lstsq(reduced, np.asarray(R.residual_shared), rcond=None)[0]
    moved = step / np.asarray(bounds.slope(at.z))
    states = np.array(at.states)
    for e, (local, crossed, left) in enumerate(
        zip(*map(np.asarray, (R.local, R.crossed, R.residual_local)), strict=True)
    ):
        states[e] -= np.linalg.lstsq(local, left + crossed @ moved, rcond=None)[0]
    lower, upper = (np.array(x) for x in (bounds.lower, bounds.upper))
    lower[free], upper[free] = -np.inf, np.inf
    without = replace(problem, bounds=Bounds(lower, upper, bounds.scale))
    return without, Unknowns(np.asarray(at.z) + moved, states), step
