"""Places among stamps as one operation of JAX's: bisection in XLA, NumPy's own from NumPy.

`jnp.searchsorted` traces to a loop of some ten turns over whole arrays, which NumPy would run turn by turn.
"""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import ShapedArray
from jax.extend.core import Primitive
from jax.interpreters import batching, mlir
from jaxtyping import Float, Int

Array = Any
"""JAX's, or what can be read as such."""


def stamps_before(stamps: Float[Array, " T"], at: Float[Array, "*n"]) -> Int[jax.Array, "*n"]:
    """How many of the increasing `stamps` lie before each of `at`; a count has no derivative."""
    return stamps_before_p.bind(jax.lax.stop_gradient(jnp.asarray(stamps)), jax.lax.stop_gradient(jnp.asarray(at)))


def stamps_before_in_numpy(stamps: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The same; with leading axes of the stamps, those of `at`, each row by itself."""
    if stamps.ndim == 1:
        return np.searchsorted(stamps, at).astype(np.int32)
    return np.stack([stamps_before_in_numpy(own, rows) for own, rows in zip(stamps, at, strict=True)])


def _bisected(stamps, at):
    search = partial(jnp.searchsorted, side="left")
    for _ in range(stamps.ndim - 1):
        search = jax.vmap(search)
    return search(stamps, at).astype(jnp.int32)


def _batched(values, axes):
    (stamps, at), (of_stamps, of_at) = values, axes
    if of_stamps is None:
        # Any axis of `at` behind those that the stamps have too.
        return stamps_before_p.bind(stamps, jnp.moveaxis(at, of_at, stamps.ndim - 1)), stamps.ndim - 1
    stamps = jnp.moveaxis(stamps, of_stamps, 0)
    at = jnp.broadcast_to(at, (len(stamps), *at.shape)) if of_at is None else jnp.moveaxis(at, of_at, 0)
    return stamps_before_p.bind(stamps, at), 0


stamps_before_p = Primitive("stamps_before")
stamps_before_p.def_impl(jax.jit(_bisected))
stamps_before_p.def_abstract_eval(lambda stamps, at: ShapedArray(at.shape, jnp.int32))
batching.primitive_batchers[stamps_before_p] = _batched
mlir.register_lowering(stamps_before_p, mlir.lower_fun(_bisected, multiple_results=False))
