"""Expressions evaluated at many points, from NumPy and without a program of XLA's."""

import ctypes
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from .machine import address, lanes
from .map_kernel import Mapped, write_map

Array = np.ndarray
Map = Callable[[Float[Array, " P"], Float[Array, "E T n"], Float[Array, "E C"]], Float[Array, "E T Y"]]
_POINTER = ctypes.POINTER(ctypes.c_double)


def _grouped(x: Array, width: int) -> Array:
    """[E, ...] -> [G, ..., width]; the last group is filled up with the last sequence."""
    groups = -(-len(x) // width)
    if groups * width > len(x):
        x = np.concatenate([x, np.repeat(x[-1:], groups * width - len(x), axis=0)])
    return np.ascontiguousarray(np.moveaxis(x.reshape(groups, width, *x.shape[1:]), 1, -1), dtype=np.float64)


def compiled_map(mapped: Mapped) -> Map:
    """`run(p [P], rows [E, T, n], carried [E, C]) -> y [E, T, Y]`: E sequences of T rows each, from what is carried."""
    width, Y = lanes(), len(mapped.outputs)
    kinds = [ctypes.c_int64] * 2 + [_POINTER] * 4
    function = ctypes.CFUNCTYPE(None, *kinds)(address(write_map(mapped, width), "map"))

    def run(p: Array, rows: Array, carried: Array) -> Array:
        E, T = rows.shape[:2]
        if E == 0 or T == 0:
            return np.zeros((E, T, Y))
        arrays = [np.ascontiguousarray(p, dtype=np.float64), _grouped(rows, width), _grouped(carried, width)]
        y = np.empty((len(arrays[1]), T, Y, width))
        function(len(y), T, *(a.ctypes.data_as(_POINTER) for a in (*arrays, y)))
        return np.moveaxis(y, -1, 1).reshape(len(y) * width, T, Y)[:E]

    return run
