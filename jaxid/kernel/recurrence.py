"""First-order linear recurrences as one operation of JAX's: a loop in XLA, machine code from NumPy.

Written as `jax.lax.scan` they could not be run in NumPy in reasonable time; written as log2(T) operations on whole arrays they
take XLA a second to compile.
"""

from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Float

from .expressions import Graph
from .map import Map, compiled_maps
from .map_kernel import Mapped
from .symbolic import inputs, scalars

Array = Any
"""JAX's, or what can be read as such."""


def recurrence(
    keep: Float[Array, "#T *#n"], new: Float[Array, " T *n"], first: Float[Array, "*n"]
) -> Float[jax.Array, " T *n"]:
    """`x[t] = keep[t] * x[t - 1] + new[t]` after `first`, |keep| <= 1."""
    new = jnp.asarray(new)
    keep = jnp.broadcast_to(keep, new.shape)
    return recurrence_p.bind(keep, jnp.concatenate([new[:1] + keep[:1] * first, new[1:]]))


@cache
def _code() -> Map:
    """x' = keep x + new along rows of (keep, new)."""

    def make() -> list[Mapped]:
        graph = Graph()
        (keep, new), (x,) = (scalars(inputs(graph, group, count)) for group, count in (("row", 2), ("carried", 1)))
        after = graph.add(graph.mul(keep, x), new)
        return [Mapped(graph, 2, [after], [after])]

    return compiled_maps("recurrence", "all columns", make)[0]


def recurrence_in_numpy(keep: np.ndarray, new: np.ndarray) -> np.ndarray:
    """From zero, in machine code; `keep` and `new` [T, ...]."""
    T, columns = len(new), new.size // max(1, len(new))
    rows = np.stack([np.broadcast_to(keep, new.shape).reshape(T, columns), new.reshape(T, columns)], axis=-1)
    found = _code()(np.zeros(0), rows.transpose(1, 0, 2), np.zeros((columns, 1)))
    return found[:, :, 0].T.reshape(new.shape)


def _looped(keep, new):
    def advance(x, row):
        x = row[0] * x + row[1]
        return x, x

    return jax.lax.scan(advance, jnp.zeros_like(new[0]), (keep, new))[1]


def _before(x):
    return jnp.concatenate([jnp.zeros_like(x[:1]), x[:-1]])


def _moved(values, tangents):
    keep, new = values
    d_keep, d_new = tangents
    x = recurrence_p.bind(keep, new)
    parts = [] if isinstance(d_new, ad.Zero) else [d_new]
    if not isinstance(d_keep, ad.Zero):
        parts.append(d_keep * _before(x))
    return x, recurrence_p.bind(keep, sum(parts)) if parts else ad.Zero(x.aval)


def _transposed(cotangent, keep, new):
    if isinstance(cotangent, ad.Zero):
        return None, ad.Zero(new.aval)
    later = jnp.flip(jnp.concatenate([keep[1:], jnp.zeros_like(keep[:1])]), 0)
    return None, jnp.flip(recurrence_p.bind(later, jnp.flip(cotangent, 0)), 0)


def _batched(values, axes):
    size = next(v.shape[axis] for v, axis in zip(values, axes, strict=True) if axis is not None)
    wide = [
        jnp.broadcast_to(v[..., None], (*v.shape, size)) if axis is None else jnp.moveaxis(v, axis, -1)
        for v, axis in zip(values, axes, strict=True)
    ]
    return recurrence_p.bind(*wide), wide[0].ndim - 1


recurrence_p = Primitive("recurrence")
recurrence_p.def_impl(jax.jit(_looped))
recurrence_p.def_abstract_eval(lambda keep, new: new)
ad.primitive_jvps[recurrence_p] = _moved
ad.primitive_transposes[recurrence_p] = _transposed
batching.primitive_batchers[recurrence_p] = _batched
mlir.register_lowering(recurrence_p, mlir.lower_fun(_looped, multiple_results=False))
