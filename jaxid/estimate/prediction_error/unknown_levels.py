r"""Covariance of the parameters where the logs know the level of a process noise only roughly.

The information at an estimate is that of noise as large as estimated. Where it was estimated too small, the standard error of
all that a disturbance moves is too small as well (for an offset in proportion). So the covariance is averaged over what the
logs leave open, by the law of total covariance:

    cov(theta) = E_q[cov(theta | q)] + cov_q(E[theta | q]),

with weights p(q | logs) from the likelihood with the parameters integrated out by Laplace's approximation and Jeffreys' prior
of q (Tierney & Kadane, J. American Statistical Association 81, 1986; Jeffreys, Proc. Royal Society A 186, 1946), which suits
a variance near zero as well as the logarithm of a large one. E[theta | q] is one scoring step from the estimate, and its
square is taken about the estimate, where the interval lies. Levels of several noises are averaged over one at a time.
"""

# ruff: noqa: F722

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray

from .uncertainties import pseudo_inverse

_ROUGHLY = 0.1
"""Standard error of a level's logarithm from which on it counts; below, it widens no interval by more than 2 %."""
_NODES = np.linspace(-4.0, 3.0, 8)
"""Where the likelihood is looked at, in standard errors of the level's logarithm; the middle lies one above the estimate."""
_SINGULAR = 1e-10
_DIVERGED = 1e29
"""-log L from which on there is none."""


class Looks(NamedTuple):
    """-log L at K points, its gradients and the information."""

    cost: Float[np.ndarray, " K"]
    gradient: Float[np.ndarray, "K p"]
    information: Float[np.ndarray, "K p p"]


class Nodes(NamedTuple):
    """Points [K, p] that differ in the level `i` of a process noise, and the spacing of its logarithm."""

    i: int
    points: Float[np.ndarray, "K p"]
    spacing: float


def nodes(x: Float[np.ndarray, " p"], information: Float[np.ndarray, "p p"], levels: range) -> list[Nodes]:
    """Where to look from the estimate `x`, for every one of the noises' `levels` that is known only roughly.

    The error of the variance q² is finite where q is zero, that of its logarithm is not: the points lie about the root of
    q² plus one standard error of it.
    """
    found = []
    errors = np.sqrt(np.maximum(np.diag(pseudo_inverse(information)), 0.0))
    for i in levels:
        with np.errstate(over="ignore"):
            variance = np.exp(2.0 * x[i])
            off = 2.0 * variance * errors[i]
        relative = 0.5 * off / (variance + off)
        if not np.isfinite(relative) or errors[i] == 0 or relative < _ROUGHLY:
            continue
        points = np.repeat(x[None], len(_NODES), axis=0)
        points[:, i] = 0.5 * np.log(variance + off) + relative * _NODES
        found.append(Nodes(i, points, relative * (_NODES[1] - _NODES[0])))
    return found


def _inverse(information: NDArray[np.float64], kept: NDArray[np.bool_]) -> tuple[NDArray[np.float64], np.float64]:
    """Inverse [p, p] of the information on what it determines of the coordinates `kept`, and half its log determinant, in
    which the other directions count as determined a little (`_SINGULAR`), at every level of the noise alike."""
    unit = 1.0 / np.sqrt(np.diag(information)[kept])
    values, vectors = np.linalg.eigh(information[np.ix_(kept, kept)] * np.outer(unit, unit))
    parts = np.where(values > _SINGULAR, 1.0 / np.maximum(values, _SINGULAR), 0.0)
    inverse = np.zeros_like(information)
    inverse[np.ix_(kept, kept)] = (vectors * parts) @ vectors.T * np.outer(unit, unit)
    return inverse, 0.5 * np.sum(np.log(np.maximum(values, _SINGULAR))) - np.sum(np.log(unit))


def _tail(slope: float, spacing: float) -> float:
    """Logarithm of the factor by which the lowest node counts more than the others, for all that lies below it: there -log L
    goes on straight with q², at the node's `slope` by log q, and Jeffreys' prior is even in q²."""
    slope = float(np.clip(0.5 * slope, -100.0, 100.0))
    edge = np.exp(-spacing)
    below = edge if abs(slope) < 1e-6 else np.exp(slope) * -np.expm1(-slope * edge) / slope
    return float(np.log1p(0.5 * below / spacing))


def _total(
    own: Nodes, looks: Looks, moved: NDArray[np.bool_], others: NDArray[np.bool_], n: int
) -> NDArray[np.float64] | None:
    """Mean square [n, n] of the parameters about their estimate, over one level; None where the filter diverges at all.

    Coordinates that are not `others` are given, and those that are not `moved` stay at the estimate.
    """
    logarithms, squares = [], []
    for cost, gradient, information in zip(*looks, strict=True):
        known = np.diag(information) > 0
        if cost > _DIVERGED or not known[own.i]:
            continue
        inverse, half = _inverse(information, others & known)
        mobile, _ = _inverse(information, moved & known)
        level = information[own.i, own.i] - information[own.i] @ inverse @ information[own.i]
        step = -mobile @ gradient
        prior = 0.5 * np.log(max(level, np.finfo(float).tiny))
        tail = _tail(gradient[own.i], own.spacing) if not logarithms else 0.0
        logarithms.append(-0.5 * step @ gradient - cost - half + prior + tail)
        squares.append(inverse[:n, :n] + np.outer(step[:n], step[:n]))
    if not logarithms:
        return None
    weight = np.exp(np.array(logarithms) - max(logarithms))
    return np.einsum("k,kij->ij", weight / weight.sum(), np.array(squares))


def averaged(
    x: Float[np.ndarray, " p"],
    information: Float[np.ndarray, "p p"],
    looks: Callable[[Float[np.ndarray, "K p"]], Looks],
    levels: range,
    moved: Bool[np.ndarray, " p"],
) -> Float[np.ndarray, "p p"]:
    """Covariance [p, p] of the coordinates at the estimate `x`: parameters first, then the logarithms of the process noises'
    `levels`, then whatever else. `looks` looks at points [K, p].

    That of the parameters is averaged over all levels that are known only roughly; where none is, it is the inverse of
    `information`. Coordinates that are not `moved` lie on a bound, where the gradient does not vanish.
    """
    covariance, n = pseudo_inverse(information), levels.start
    roughly = nodes(x, information, levels)
    if not roughly:
        return covariance
    own = covariance[:n, :n]
    unit = np.sqrt(np.diag(own))
    unit = np.where(unit > 0, unit, 1.0)
    values, vectors = np.linalg.eigh(own / np.outer(unit, unit))
    kept = values > _SINGULAR * max(values.max(), 1e-300)
    into = (vectors[:, kept] / np.sqrt(values[kept])).T / unit  # whitens what is determined
    out = unit[:, None] * vectors[:, kept] * np.sqrt(values[kept])
    others = np.ones(len(x), dtype=bool)
    others[levels.start : levels.stop] = False
    logarithm = np.zeros((int(kept.sum()),) * 2)
    for one in roughly:
        found = _total(one, looks(one.points), others & moved, others, n)
        if found is not None:
            grown, directions = np.linalg.eigh(into @ found @ into.T)
            logarithm += (directions * np.log(np.maximum(grown, _SINGULAR))) @ directions.T
    grown, directions = np.linalg.eigh(logarithm)
    # Several levels: their factors multiply.
    change = out @ (directions * np.exp(0.5 * grown)) @ directions.T @ into
    change += np.eye(n) - out @ into
    whole = np.eye(len(covariance))
    whole[:n, :n] = change
    return whole @ covariance @ whole.T
