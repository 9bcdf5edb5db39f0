"""Functions of whole records, run where they are done soonest: in NumPy at once, or, once they have run long, in XLA."""

from collections.abc import Callable, Hashable, Sequence
from functools import lru_cache, partial
from hashlib import blake2b
from typing import Any

import jax
import numpy as np

from .._compile import compiled
from .in_numpy import in_numpy
from .symbolic import Untranslated

_MOST_FUNCTIONS = 256
_COMPILED = 0.008
"""Seconds that XLA takes to compile an operation, of which its program, some times as fast, is worth those that NumPy's have
run (`in_numpy`)."""
_KEPT, _SMALL = 64, 50_000
"""Results that are kept, of so many numbers at most that they are made from."""


def in_numpy_or_xla(
    function: Callable[..., Any], fixed: tuple[Hashable, ...], arrays: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """The arrays that `function(*fixed, *arrays)` returns, a sequence.

    `function`: of JAX's operations; with the values `fixed` and arrays of the same shapes it is traced once. What was computed
    of few numbers is kept and found again where they are the same, and may not be written to.
    """
    if sum(array.size for array in arrays) <= _SMALL:
        return _found_once(_Asked(function, fixed, arrays))
    return _runs(function, fixed, tuple(array.shape for array in arrays))(*arrays)


@lru_cache(_MOST_FUNCTIONS)
def in_xla(function: Callable[..., Any], fixed: int) -> Callable[..., Any]:
    """`function` compiled, whose first `fixed` arguments are no arrays."""
    return compiled(function, static_argnums=tuple(range(fixed)))


class _Runs:
    """A function of arrays of given shapes, and how long it has been run: what runs long is worth compiling."""

    def __init__(self, function: Callable[..., Any], fixed: tuple[Any, ...], shapes: tuple[tuple[int, ...], ...]):
        self.function, self.fixed, self.left = function, fixed, -1.0
        try:
            arrays = (jax.ShapeDtypeStruct(shape, float) for shape in shapes)
            self.steps = in_numpy(partial(function, *fixed), *arrays)
            self.left = _COMPILED * len(self.steps.steps)
        except Untranslated:
            pass

    def __call__(self, *arrays: np.ndarray) -> list[np.ndarray]:
        if self.left < 0.0:
            return [np.asarray(found) for found in in_xla(self.function, len(self.fixed))(*self.fixed, *arrays)]
        self.left -= self.steps.seconds
        return self.steps(*arrays)


_runs = lru_cache(_MOST_FUNCTIONS)(_Runs)


class _Asked:
    """What is to be computed of arrays; the same where their bits are."""

    def __init__(self, function: Callable[..., Any], fixed: tuple[Any, ...], arrays: Sequence[np.ndarray]):
        self.function, self.fixed, self.arrays = function, fixed, arrays
        self.shapes = tuple(array.shape for array in arrays)
        digest = blake2b(digest_size=16)
        for array in arrays:
            digest.update(array.tobytes())
        self.key = function, fixed, self.shapes, digest.digest()

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: Any) -> bool:
        return self.key == other.key


@lru_cache(_KEPT)
def _found_once(asked: _Asked) -> list[np.ndarray]:
    found = _runs(asked.function, asked.fixed, asked.shapes)(*asked.arrays)
    # A function may pass on what it was given, which is its caller's own.
    found = [np.array(x) if any(np.may_share_memory(x, own) for own in asked.arrays) else x for x in found]
    for array in found:
        array.flags.writeable = False
    del asked.arrays
    return found
