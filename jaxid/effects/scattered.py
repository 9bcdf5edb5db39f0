"""Delays that scatter: what chance makes once of a signal of which a law is the mean over all delays.

NumPy, since nothing is fitted to a draw. All take the edges of the steps or the stamps in seconds, and delays even between none
and `longest`.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def _means(values: Array, begins: Array, edges: Array) -> Array:
    """Means over the steps between `edges` [T + 1] of a signal that is `values` [n, m] from `begins` [n], increasing, on."""
    ends = np.append(begins[1:], max(edges[-1], begins[-1]) + 1.0)
    whole = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values * (ends - begins)[:, None], axis=0)])
    at = np.append(begins, ends[-1])
    integrals = np.stack([np.interp(edges, at, column) for column in whole.T], axis=1)
    return np.diff(integrals, axis=0) / np.diff(edges)[:, None]


def changes_late(inputs: Array, edges: Array, longest: float, random: np.random.Generator) -> Array:
    """Held `inputs` [T, m] of which every change comes late by a time of its own, none before the one before it."""
    first = np.flatnonzero(np.any(np.diff(inputs, axis=0) != 0, axis=1)) + 1
    come = np.maximum.accumulate(edges[first] + random.uniform(0.0, longest, len(first)))
    rows = np.append(0, first)
    return _means(inputs[rows], np.append(edges[0], come), edges)


def rows_late(inputs: Array, edges: Array, longest: float, random: np.random.Generator) -> Array:
    """Held `inputs` [T, m], every row of which shows them as they were a time of its own ago."""
    delays = random.uniform(0.0, longest, len(inputs))
    steps = np.diff(edges)
    # Before the start there is what was commanded first.
    whole = np.concatenate(
        [-inputs[:1] * longest, np.zeros_like(inputs[:1]), np.cumsum(inputs * steps[:, None], axis=0)]
    )
    at = np.append(edges[0] - max(longest, np.finfo(float).tiny), edges)
    then = [np.interp(edges[1:] - delays, at, c) - np.interp(edges[:-1] - delays, at, c) for c in whole.T]
    return np.stack(then, axis=1) / steps[:, None]


def samples_late(outputs: Array, time: Array, longest: float, random: np.random.Generator) -> Array:
    """`outputs` [T, m] at stamps from which each was measured a time of its own earlier."""
    then = time - random.uniform(0.0, longest, len(time))
    return np.stack([np.interp(then, time, column) for column in outputs.T], axis=1)
