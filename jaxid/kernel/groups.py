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
    return np.ascontiguousarray(np.moveaxis(x.reshape(groups, width, *x.shape[1:]), 1, -1), dtype=np.float64)


def ungrouped(x: Array, E: int) -> Array:
    """[G, ..., L] -> [E, ...]."""
    return np.moveaxis(x, -1, 1).reshape(x.shape[0] * x.shape[-1], *x.shape[1:-1])[:E]
