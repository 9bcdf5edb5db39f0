"""Standard errors, what the data does not determine, and combinations that it does."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import jax
import numpy as np
from numpy.typing import NDArray

from .._compile import Program, compiled
from ..robots.robot import Robot
from .result import Estimate, Status

RANK = 1e-9
"""Singular values below this share of the largest (columns scaled to one) count as zero."""
PRACTICAL = 1.0
"""A standard error above this multiple of the parameter's magnitude: the data says nothing useful about it."""
TYPICALLY = 30.0
"""Times the size to expect of a parameter of either sign, or of one on its bound, beyond which an error says nothing of it,
whatever would change the simulation."""


_PART, _ROUNDING = 1e-3, 1e-5
"""Share of a free direction from which a parameter takes part in it, and the share, in columns of length one, below which that
may be rounding."""


class Spread(NamedTuple):
    """Covariance of the free parameters, which single parameters the data determines, and which take part in a direction
    that it leaves entirely free."""

    covariance: NDArray[np.float64]
    determined: NDArray[np.bool_]
    unseen: NDArray[np.bool_]


def takes_part(
    directions: NDArray[np.float64], lengths: NDArray[np.float64], magnitude: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which parameters [n] move along any of the free `directions` [k, n] of a Jacobian whose columns, of these `lengths`, were
    scaled to one.

    A parameter that hardly shows has a small part of such a direction in those units, and may yet have to change as much, for
    its `magnitude`, as the ones that show it best. Nothing bounds it then.
    """
    if not len(directions):
        return np.zeros(len(lengths), dtype=bool)
    own = np.abs(directions)
    shown = (lengths > 0) & (magnitude > 0) & np.isfinite(magnitude)
    change = np.where(shown, own / (np.where(shown, lengths, 1.0) * np.where(shown, magnitude, 1.0)), 0.0)
    relative = change > _PART * np.maximum(change.max(axis=1, keepdims=True), 1e-300)
    return np.any((own > _PART) | relative & (own > _ROUNDING), axis=0)


def spread(jacobian: NDArray[np.float64], free: NDArray[np.bool_], magnitude: NDArray[np.float64]) -> Spread:
    """Covariance (JᵀJ)⁻¹ from a whitened Jacobian `[m, n]` with respect to the physical parameters.

    Parameters that are not `free` have zero variance. Directions that the Jacobian leaves at zero get no variance of
    their own; the parameters that take part in them are not determined. A Jacobian that overflowed (of a simulation in which
    every difference grows without limit) tells nothing of any of them.
    """
    n = jacobian.shape[1]
    covariance = np.zeros((n, n))
    determined, unseen = np.array(free), np.zeros(n, dtype=bool)
    index = np.flatnonzero(free)
    if index.size == 0:
        return Spread(covariance, determined, unseen)
    if not np.isfinite(jacobian[:, index]).all():
        unseen[index] = True
        return Spread(covariance, np.zeros(n, dtype=bool), unseen)
    block = jacobian[:, index]
    norms = np.linalg.norm(block, axis=0)
    used = np.where(norms > 0, norms, 1.0)
    _, singular, Vt = np.linalg.svd(block / used, full_matrices=True)
    values = np.zeros(index.size)
    values[: singular.size] = singular
    zero = values <= RANK * max(values.max(), 1e-300)
    inverse = np.where(zero, 0.0, 1.0 / np.where(zero, 1.0, values) ** 2)
    scaled = (Vt.T * inverse) @ Vt
    covariance[np.ix_(index, index)] = scaled / np.outer(used, used)
    in_null_space = takes_part(Vt[zero], norms, magnitude[index])
    errors = np.sqrt(np.diag(covariance)[index])
    unseen[index] = in_null_space | (norms == 0)
    determined[index] = ~unseen[index] & (errors <= PRACTICAL * magnitude[index])
    return Spread(covariance, determined, unseen)


def with_covariance(found: Spread, covariance: NDArray[np.float64], magnitude: NDArray[np.float64]) -> Spread:
    """The same directions with another `covariance` [n, n], which may determine fewer parameters."""
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return found._replace(covariance=covariance, determined=found.determined & ~(errors > PRACTICAL * magnitude))


@lru_cache(64)
def _with_slope(function: Callable[[Mapping[str, Any]], Any]) -> Program:
    """(value, derivative by the free ones) of a combination of parameters, compiled."""
    return compiled(jax.value_and_grad(lambda free, fixed: function({**fixed, **free})))


def combinations(
    robot: Robot, numbers: Mapping[str, float], names: tuple[str, ...], covariance: NDArray[np.float64]
) -> dict[str, Estimate]:
    """The robot's combinations with standard errors by the delta method. Call under float64."""
    found: dict[str, Estimate] = {}
    for label, (function, unit, _) in robot.combinations.items():
        free = {name: float(numbers[name]) for name in names}
        fixed = {name: float(value) for name, value in numbers.items() if name not in free}
        value, gradient = _with_slope(function)(free, fixed)
        g = np.array([float(gradient[name]) for name in names])
        found[label] = Estimate.of(float(value), float(np.sqrt(max(g @ covariance @ g, 0.0))), unit)
    return found


def estimates(
    robot: Robot,
    values: Mapping[str, float],
    names: tuple[str, ...],
    spread_: Spread,
    at_bound: NDArray[np.bool_],
) -> dict[str, Estimate]:
    """An `Estimate` for every parameter of the robot's table."""
    found: dict[str, Estimate] = {}
    for name, parameter in robot.parameters.items():
        if name not in names:
            found[name] = Estimate.of(parameter.value, float("nan"), parameter.unit, "fixed")
            continue
        i = names.index(name)
        status: Status = "identified"
        if not spread_.determined[i]:  # on a bound, too: there it is where the search ended
            status = "not_identifiable"
        elif at_bound[i]:
            status = "at_bound"
        # In a direction that nothing shows there is no error to give: it is not small, but without end.
        error = float("inf") if spread_.unseen[i] else float(np.sqrt(spread_.covariance[i, i]))
        estimate = Estimate.of(values[name], error, parameter.unit, status)
        low, high = estimate.ci95
        found[name] = replace(estimate, ci95=(max(low, parameter.lower), min(high, parameter.upper)))
    return found
