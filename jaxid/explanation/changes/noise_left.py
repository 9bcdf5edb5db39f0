"""The colour of the noise in two sets of logs of which several things may differ.

What one candidate leaves of the difference is noise only if nothing else has changed: a second change, a sensor's bias or a
floor that slopes, would pass for slow noise, and whitening would hide it. Candidates are added one after another (forward
selection) as long as the likelihood of what is left, with coloured noise of its own, grows by more than they cost (Schwarz's
criterion): slow noise is no less likely with a change, a change is less likely as slow noise.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .candidates import Side
from .joint import SIDES, Colours, Pair
from .moved import Changes, Linear
from .whitened import Whitened, answer

Array = NDArray[np.float64]
MOST, _TRIED = 4, 3
"""Candidates that are added at most, and how many of the most promising are tried for each."""
_STEADY = 1e-3
"""Share of what a candidate changes that may vary within a log where it is the same at all times."""
_OLD = 1e-8
"""Length, in those of a candidate's coordinates, below which it adds nothing to those before."""


class NoiseLeft(NamedTuple):
    """The `colours` of what is left of both sides, the changes that were `taken` off for it, and the cost in likelihood of all
    of these."""

    colours: Colours
    taken: tuple[Changes, ...] = ()
    cost: float = np.inf

    def without(self, view: Whitened) -> Array:
        """What is left [rows] once these changes are taken off in this view."""
        basis = basis_of(view, self.taken)
        return view.left - basis @ (basis.T @ view.left)


def noise_left(
    seen: Linear, plain: Whitened, every: Sequence[Array], first: Sequence[Changes] = (), most: int = MOST
) -> NoiseLeft:
    """What is noise once everything that makes the rest likelier has been taken off, `most` changes of it and `first` in any
    case; `plain` is all of it in units of white noise, with `every` change's directions. Beyond these it is what never changes
    within a log that is taken off, a sensor's bias: no noise has a mean, and whitened as slow noise it is gone."""
    taken, basis = tuple(first), basis_of(plain, first)
    left = plain.left - basis @ (basis.T @ plain.left)
    cost, colours = likelihood_cost(seen.pair, plain.shaped(left))
    cost += basis.shape[1] * np.log(len(left))
    sides = seen.pair.sides
    steady = [i for i, own in enumerate(seen.changes) if _steady(own, sides[own.candidate.side].there)]
    rounds = [(range(len(every)), most - len(first)), (steady, MOST if most < MOST else 0)]
    for among, times in rounds:
        for _ in range(times):
            tried = []
            for i in _promising(seen, plain, every, left, colours, among):
                wider = _with(basis, every[i])
                remains = plain.left - wider @ (wider.T @ plain.left)
                own, their = likelihood_cost(seen.pair, plain.shaped(remains))
                tried.append((own + wider.shape[1] * np.log(len(left)), wider, remains, their, seen.changes[i]))
            best = min(tried, key=lambda own: own[0], default=None)
            # One of many: by chance the best of so many gains twice the logarithm of their number.
            if best is None or best[0] > cost - 2.0 * np.log(len(every)):
                break
            cost, basis, left, colours, change = best
            taken = (*taken, change)
    return NoiseLeft(colours, taken, cost)


def basis_of(view: Whitened, changes: Sequence[Changes]) -> Array:
    """An orthonormal basis [rows, m] of what these changes do."""
    basis = np.zeros((len(view.left), 0))
    for change in changes:
        basis = _with(basis, view.directions(change))
    return basis


def _with(basis: Array, D: Array) -> Array:
    """The orthonormal `basis` [rows, m] and what the columns of `D` [rows, k] add to it."""
    size = np.linalg.norm(D, axis=0)
    new = D[:, size > 0] / size[size > 0]
    new = new - basis @ (basis.T @ new)
    U, s, _ = np.linalg.svd(new, full_matrices=False)
    return np.concatenate([basis, U[:, s > _OLD]], axis=1)


def likelihood_cost(pair: Pair, left: Mapping[Side, Array]) -> tuple[float, Colours]:
    """Twice the negative logarithm of the likelihood of what is `left` [E, T, ny] as noise of colours of its own, with what
    their coefficients cost; and these colours."""
    colours: Colours = {side: pair.sides[side].colours(left[side]) for side in SIDES}
    found = 0.0
    for side, own in pair.sides.items():
        counts = own.there.sum(axis=(0, 1))
        for count, colour in zip(counts, colours[side], strict=True):
            found += count * 2.0 * np.log(colour.level) + colour.order * np.log(max(count, 2)) if count else 0.0
    return float(found), colours


def _steady(change: Changes, there: NDArray[np.bool_]) -> bool:
    """Whether a candidate moves each reading, where it is `there` [E, T, ny], by as much at all times."""
    high = np.where(there, change.outputs, -np.inf).max(axis=-2)
    low = np.where(there, change.outputs, np.inf).min(axis=-2)
    seen = np.isfinite(high) & np.isfinite(low)
    size = np.abs(np.where(seen, high, 0.0)).max(initial=0.0)
    return bool(size > 0.0 and np.where(seen, high - low, 0.0).max(initial=0.0) <= _STEADY * size)


def _promising(
    seen: Linear, plain: Whitened, every: Sequence[Array], left: Array, colours: Colours, among: Sequence[int]
) -> list[int]:
    """The candidates `among` these that explain most of what is `left`, as it is and whitened for noise of these colours."""

    def whitened(rows: Array) -> Array:
        """Columns [rows, k] filtered."""
        parts = [plain.shaped(column) for column in rows.T]
        columns = [
            np.concatenate([seen.pair.sides[s].whiten(own[s], colours[s]).reshape(-1) for s in SIDES]) for own in parts
        ]
        return np.stack(columns, axis=1) if columns else rows

    views: list[tuple[Sequence[Array], Array]] = [(every, left)]
    if any(colour.order for own in colours.values() for colour in own):
        views.append(([whitened(D) for D in every], whitened(left[:, None])[:, 0]))
    found: dict[int, None] = {}
    for directions, rest in views:
        gains = [
            answer(directions[i], rest, seen.changes[i].positive)[1] - directions[i].shape[1] * np.log(len(rest))
            for i in among
        ]
        found |= dict.fromkeys(among[k] for k in np.argsort(gains)[::-1][:_TRIED])
    return list(found)
