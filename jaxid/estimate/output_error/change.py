"""Whether what is seen now contradicts what was seen before: estimates of the same parameters from different samples.

Two estimates scatter about one truth by the sum of their covariances. Both are kept as information, which is zero, not
infinite, in a direction that nothing shows, and so is the weight of such a direction in the comparison.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
_SEEN = 1e-10
"""Share of the best told direction below which a difference is not told."""


@dataclass(frozen=True)
class Knowledge:
    """What samples up to `time` say of n parameters: `mean` [n], `information` [n, n], `pull` [n] = information @ mean.

    `scatter` [n, n] is the covariance of `pull`: that of older samples counts less often than they weigh, for discounting
    information by a factor discounts the scatter by its square.
    """

    time: float
    mean: Array
    information: Array
    pull: Array
    scatter: Array

    def with_(self, before: "Knowledge", decay: float) -> "Knowledge":
        """Together with what was known `before` of other samples, discounted by `decay`."""
        information = self.information + decay * before.information
        pull = self.pull + decay * before.pull
        # From the estimate on: directions that nothing shows stay where they are.
        mean = self.mean + solved(information, pull - information @ self.mean)
        return Knowledge(self.time, mean, information, pull, self.scatter + decay**2 * before.scatter)

    def without(self, gone: NDArray[np.bool_]) -> "Knowledge":
        """What is known of the other parameters where nothing is of those that are `gone` [n]."""
        among, across = (self.information[np.ix_(rows, gone)] for rows in (gone, ~gone))
        turn = np.diag(np.where(gone, 0.0, 1.0))
        turn[np.ix_(~gone, gone)] = -across @ np.linalg.pinv(among, hermitian=True)
        information = turn @ self.information @ turn.T
        return Knowledge(self.time, self.mean, information, information @ self.mean, turn @ self.scatter @ turn.T)


class Change(NamedTuple):
    """`p_value` of the whole difference by chance, NaN where nothing can be compared; the places `changed` of parameters."""

    p_value: float
    changed: tuple[int, ...]


def solved(A: Array, b: Array) -> Array:
    """The shortest x of A x = b, A symmetric, in units of its diagonal."""
    size = np.sqrt(np.maximum(np.diag(A), 0.0))
    units = np.where(size > 0, size, 1.0)
    return np.linalg.lstsq(A / np.outer(units, units), b / units, rcond=_SEEN)[0] / units


def square_root(information: Array) -> Array:
    """Root [n, n] of an information."""
    values, vectors = np.linalg.eigh(information)
    return (np.sqrt(np.maximum(values, 0.0)) * vectors).T


def change(before: Knowledge | None, now: Knowledge, size: Array, alarm: float) -> Change:
    """Whether `now` differs from what was known `before`, of other samples; `size` [n] of the parameters.

    The chi-squared test of all differences together; where it is less likely than `alarm`, as few parameters are named as
    explain what differs by more than chance (Bonferroni).
    """
    if before is None:
        return Change(np.nan, ())
    units = np.outer(size, size)
    old, new, scatter = (x * units for x in (before.information, now.information, before.scatter))
    # In directions that either does not show there is nothing to compare: scaled to the weaker.
    values, vectors = np.linalg.eigh(old)
    told = values > _SEEN * max(values.max(), 1e-300)
    root = vectors[:, told] / values[told]
    covariance = root @ (vectors[:, told].T @ scatter @ vectors[:, told]) @ root.T
    inside = vectors[:, told]
    # What the window says of these directions, the others being unknown.
    outside = vectors[:, ~told]
    own = new
    pull = now.pull * size - new @ (before.mean / size)
    if outside.shape[1]:
        across = new @ outside
        weight = np.linalg.pinv(outside.T @ across, rcond=_SEEN, hermitian=True)
        own, pull = new - across @ weight @ across.T, pull - across @ (weight @ (outside.T @ pull))
    reduced, right = inside.T @ own @ inside, inside.T @ pull
    # (C + own^-1)^-1 = own - own (own + C^-1)^-1 own, without the inverse of what may be singular.
    spread = inside.T @ covariance @ inside
    joint = np.linalg.solve(np.eye(len(reduced)) + reduced @ spread, np.column_stack([reduced, right]))
    precision, score = 0.5 * (joint[:, :-1] + joint[:, :-1].T), joint[:, -1]
    eigen, axes = np.linalg.eigh(precision)
    kept = eigen > _SEEN * max(eigen.max(initial=0.0), 1e-300)
    if not kept.any():
        return Change(np.nan, ())
    statistic = float(np.sum((axes[:, kept].T @ score) ** 2 / eigen[kept]))
    p = float(scipy.special.chdtrc(int(kept.sum()), statistic))
    if not p < alarm:
        return Change(p, ())
    limit = -float(scipy.special.ndtri(0.5 * alarm / len(size)))
    return Change(p, _named(inside @ precision @ inside.T, inside @ score, limit))


def _named(precision: NDArray[Any], score: NDArray[Any], limit: float) -> tuple[int, ...]:
    """Parameters whose change explains the difference best, one after the other, until nothing beyond the `limit` (standard
    deviations) is left; the best one in any case."""
    found: list[int] = []
    for _ in range(len(score)):
        own = np.diag(precision)
        free = own > _SEEN * max(own.max(), 1e-300)
        free[found] = False
        z = np.where(free, np.abs(score) / np.sqrt(np.where(free, own, 1.0)), 0.0)
        best = int(np.argmax(z))
        if not free.any() or (found and not z[best] > limit):
            break
        found.append(best)
        column = precision[:, best] / precision[best, best]
        score, precision = score - column * score[best], precision - np.outer(column, precision[best])
    return tuple(found)
