"""Residuals and first-order changes whitened for noise of given colours, and score tests on them."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..._distributions import chi_squared_tail
from .candidates import Side
from .joint import SIDES, Colours, block_sums, blocks_of, flat, project, stacked
from .moved import Changes, Linear

Array = NDArray[np.float64]
_ALIKE = 1e-6
"""Length, in those of a candidate's coordinates, below which what is left of a direction is rounding."""
_DISAGREE = 0.01
_FEW_LOGS = 2.0
_APART = 10_000_000  # numbers of one side's logs and of the other's


class Whitened:
    """Everything whitened for noise of given colours: the residual and the shared columns, initial states projected off."""

    def __init__(self, seen: Linear, colours: Colours, residual: Mapping[Side, Array] | None = None):
        """Of what is left at the first fit's numbers, or of another `residual` [E, T, ny] of each side."""
        self.pair, self.colours, self.states = seen.pair, colours, {}
        self.residual, self.columns = {}, {}
        for side in SIDES:
            own = self.pair.sides[side]
            S = own.whiten(seen.states[side], colours[side])
            self.states[side] = np.moveaxis(flat(S), 0, -1)
            r = own.whiten((residual or seen.residual)[side], colours[side])
            C = own.whiten(seen.columns[side], colours[side])
            C = np.moveaxis(flat(C), 0, -1)
            self.columns[side], self.residual[side], _ = project(C, flat(r), self.states[side], own.state_stiffness)
        C = stacked(self.columns)
        size = np.linalg.norm(C, axis=0)
        U, s, _ = np.linalg.svd(C / np.where(size > 0, size, 1.0), full_matrices=False)
        self.basis = U[:, s > 1e-8 * max(s.max(initial=0.0), 1e-300)]
        y = stacked(self.residual)
        self.left = y - self.basis @ (self.basis.T @ y)

    @property
    def logs(self) -> NDArray[np.int64]:
        """Number of the log of each row."""
        parts = (np.repeat(np.arange(len(r)) + i * _APART, r.shape[1]) for i, r in enumerate(self.residual.values()))
        return np.concatenate(list(parts))

    def blocks(self, left: Array) -> NDArray[np.int64]:
        """Number of the block of time of each row: longer than what is `left` remembers."""
        return stacked(blocks_of(self.pair, self.shaped(left))).astype(np.int64)

    def directions(self, changes: Changes) -> Array:
        """[rows, k], what shared parameters and initial states take up taken off."""
        side, own = changes.candidate.side, self.pair.sides[changes.candidate.side]
        D = own.whiten(changes.outputs, self.colours[side])
        D = np.moveaxis(flat(D), 0, -1)
        D, _, _ = project(D, self.residual[side], self.states[side], own.state_stiffness)
        other: Side = "before" if side == "after" else "after"
        parts: dict[Side, Array] = {}
        parts[side], parts[other] = D, np.zeros((*self.residual[other].shape, D.shape[-1]))
        rows = stacked(parts)
        return rows - self.basis @ (self.basis.T @ rows)

    def shaped(self, rows: Array) -> dict[Side, Array]:
        """A vector of rows as [E, T, ny] of each side."""
        before, after = (self.pair.sides[s].there for s in SIDES)
        found: dict[Side, Array] = {"before": rows[: before.size].reshape(before.shape)}
        found["after"] = rows[before.size :].reshape(after.shape)
        return found


def answer(D: Array, left: Array, positive: bool) -> tuple[Array, float]:
    """Sizes [k] that explain most, and the drop of the sum of squares."""
    size = np.linalg.norm(D, axis=0)
    size = np.where(size > 0, size, np.inf)
    delta = -np.linalg.lstsq(D / size, left, rcond=1e-8)[0] / size
    if positive and len(delta) and delta[np.argmax(np.abs(delta))] < 0.0:
        return np.zeros_like(delta), 0.0
    return delta, float(-left @ (D @ delta))


def wider(D: Array, left: Array, blocks: NDArray[np.int64], logs: NDArray[np.int64], free: int) -> Array:
    """By how much the scores of each column scatter more than white noise would let them [k], at least one: by blocks of time,
    and between logs where that is more than chance."""
    size = np.sum(D**2, axis=0)
    size = np.where(size > 0, size, 1.0)
    u = block_sums(D * left[:, None], blocks)
    broad = np.maximum(np.sum(u**2, axis=0) / size * len(u) / max(len(u) - free, 1), 1.0)
    starts = np.flatnonzero(np.diff(logs, prepend=-1))
    own, share = np.add.reduceat(D * left[:, None], starts, axis=0), np.add.reduceat(D**2, starts, axis=0) / size
    counts = 1.0 / np.maximum(np.sum(share**2, axis=0), 1e-300)
    freedom = np.maximum(counts - 1.0, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sum(own**2, axis=0) / size / broad * counts / freedom
        chance = chi_squared_tail(ratio * freedom, freedom)
    sure = np.isfinite(ratio) & (freedom > _FEW_LOGS) & (chance < _DISAGREE)
    return np.sqrt(broad * np.where(sure, np.maximum(ratio, 1.0), 1.0))


def statistic(
    D: Array, left: Array, remains: Array, blocks: NDArray[np.int64], logs: NDArray[np.int64], free: int
) -> tuple[float, int]:
    """The score test of the columns of `D` on what is `left`, whose scatter is that of what `remains`, and its degrees of
    freedom.

    By directions at right angles: of columns that are nearly the same, the little in which they differ scatters by itself, and
    not as each of them does.
    """
    U, s, _ = np.linalg.svd(D / np.linalg.norm(D, axis=0), full_matrices=False)
    U = U[:, s > _ALIKE]
    return float(np.sum((U.T @ left / wider(U, remains, blocks, logs, free)) ** 2)), U.shape[1]
