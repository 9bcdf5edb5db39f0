"""Expressions evaluated at many points, from NumPy and without a program of XLA's."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from .groups import grouped, ungrouped
from .machine import function, lanes, loaded
from .map_kernel import Mapped, write_map

Array = np.ndarray
Map = Callable[[Float[Array, " P"], Float[Array, "E T n"], Float[Array, "E C"]], Float[Array, "E T Y"]]


def compiled_map(mapped: Mapped) -> Map:
    """`run(p [P], rows [E, T, n], carried [E, C]) -> y [E, T, Y]`: E sequences of T rows each, from what is carried."""
    width, Y = lanes(), len(mapped.outputs)
    machine = function(loaded(write_map(mapped, width)), "map", 2, 4)

    def run(p: Array, rows: Array, carried: Array) -> Array:
        E, T = rows.shape[:2]
        if E == 0 or T == 0:
            return np.zeros((E, T, Y))
        arrays = [np.ascontiguousarray(p, dtype=np.float64), grouped(rows), grouped(carried)]
        y = np.empty((len(arrays[1]), T, Y, width))
        machine(len(y), T, *arrays, y)
        return ungrouped(y, E)

    return run
