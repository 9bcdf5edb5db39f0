"""Sequences side by side in lanes, as machine code reads them, of NumPy's arrays."""

import numpy as np

from .machine import lanes

Array = np.ndarray


def grouped(x: Array) -> Array:
    """[E, ...] -> [G, ..., L]: lanes side by side; the last group is filled up with the last sequence."""
    width = lanes()
    groups = -(-len(x) // width)
    if groups * width > len(x):
        x = np.concatenate([x, np.repeat(x[-1:], groups * width - len(x), axis=0)])
    apart = x.reshape(groups, width, *x.shape[1:])
    return np.ascontiguousarray(apart.transpose(0, *range(2, apart.ndim), 1), dtype=np.float64)


def ungrouped(x: Array, E: int) -> Array:
    """[G, ..., L] -> [E, ...]."""
    together = x.transpose(0, x.ndim - 1, *range(1, x.ndim - 1))
    return together.reshape(x.shape[0] * x.shape[-1], *x.shape[1:-1])[:E]
