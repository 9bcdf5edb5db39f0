"""Expressions evaluated at many points, from NumPy and without a program of XLA's."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .groups import grouped, ungrouped
from .machine import function, lanes, loaded
from .map_kernel import Mapped, write_map
from .remembered import Made, remembered

Array = np.ndarray


class Map(NamedTuple):
    """Loaded machine code of `outputs` expressions."""

    code: Callable[..., None]
    outputs: int

    def __call__(
        self, p: Float[Array, " P"], rows: Float[Array, "E T n"], carried: Float[Array, "E C"]
    ) -> Float[Array, "E T Y"]:
        """E sequences of T rows each, from what is carried."""
        E, T = rows.shape[:2]
        if E == 0 or T == 0:
            return np.zeros((E, T, self.outputs))
        arrays = [np.ascontiguousarray(p, dtype=np.float64), grouped(rows), grouped(carried)]
        y = np.empty((len(arrays[1]), T, self.outputs, lanes()))
        self.code(len(y), T, *arrays, y)
        return ungrouped(y, E)


def compiled_maps(identity: str | None, purpose: str, make: Callable[[], Sequence[Mapped]]) -> list[Map]:
    """Machine code of what `make` makes for a `purpose` of the model that has this `identity` (`remembered`)."""

    def compiled() -> Made:
        made = make()
        return Made(tuple(loaded(write_map(one, lanes())) for one in made), tuple(len(one.outputs) for one in made))

    found = remembered(identity, purpose, compiled)
    return [Map(function(name, "map", 2, 4), Y) for name, Y in zip(found.code, found.numbers, strict=True)]
