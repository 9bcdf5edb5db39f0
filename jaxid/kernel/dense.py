"""Decompositions of small dense matrices as functions of JAX: under `jit` and `vmap`, lane by lane.

jaxlib's own (LAPACK's) hand the matrices of a batch to the threads on which programs run, and wait for them there: several
at a time can wait for one another for ever. These run on one thread, a matrix a lane. On other devices, and in single
precision, JAX's own are called. NumPy's arrays are decomposed by the same machine code without a program around it.
"""

from collections.abc import Callable
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import custom_vmap
from jaxtyping import Float

from .._arrays import AnyArray as Array
from . import direct
from .call import grouped, ungrouped
from .dense_kernel import write_rotation, write_solution, write_triangle
from .machine import lanes, loaded, register, write_handler


@cache
def _target(write: Callable, results: int) -> str:
    module = write(lanes())
    write_handler(module, [(0, 0), (0, 1), (0, 2)], 1, results, function=module.name)
    return register(loaded(module, rewrite=True))


def _here(A: Array) -> bool:
    return jax.default_backend() == "cpu" and A.dtype == jnp.float64


def _in_lanes(name: str, A: Array, *shapes: tuple[int, int]) -> list[Array]:
    """The results of A [..., m, n], of these shapes behind A's leading axes."""
    ahead = A.shape[:-2]
    flat = A.reshape(-1, *A.shape[-2:])
    E, width = flat.shape[0], lanes()
    kinds = [jax.ShapeDtypeStruct((-(-E // width), *shape, width), jnp.float64) for shape in shapes]
    found = jax.ffi.ffi_call(name, kinds)(grouped(flat, width))
    return [ungrouped(x, E).reshape(*ahead, *shape) for x, shape in zip(found, shapes, strict=True)]


def _batched(inner: Callable) -> Callable:
    """`inner`, which takes any leading axes, under `vmap`."""
    wrapped = custom_vmap(inner)

    @wrapped.def_vmap
    def _(size, batched, A):
        found = wrapped(A)
        return found, jax.tree.map(lambda _: True, found)

    return wrapped


@_batched
def _triangle(A: Array) -> Array:
    m, n = A.shape[-2:]
    (R,) = _in_lanes(_target(write_triangle, 1), A, (n, n))
    return R


def triangle_of(A: Float[Array, "*E m n"]) -> Float[Array, "*E n n"]:
    """The triangle R of A = Q R, its diagonal not negative; rows of zeros, but for rounding, where A has fewer
    rows than columns.

    With a non-negative diagonal it varies continuously with A.
    """
    if isinstance(A, np.ndarray):
        return direct.triangles(A)
    m, n = A.shape[-2:]
    if not _here(A):
        missing = jnp.zeros((*A.shape[:-2], max(n - m, 0), n), A.dtype)
        R = jnp.linalg.qr(jnp.concatenate([A, missing], axis=-2), mode="r")
        return jnp.where(jnp.diagonal(R, axis1=-2, axis2=-1)[..., None] < 0, -R, R)
    if A.ndim == 2 and m > 2 * lanes() * n:
        # One tall matrix: its parts in lanes, then their triangles.
        part = -(-m // lanes())
        A = jnp.concatenate([A, jnp.zeros((part * lanes() - m, n))])
        A = _triangle(A.reshape(lanes(), part, n)).reshape(lanes() * n, n)
    return _triangle(A)


@_batched
def _rotation(A: Array) -> tuple[Array, Array]:
    m, n = A.shape[-2:]
    B, V = _in_lanes(_target(write_rotation, 2), A, (n, m), (n, n))
    return B, V


def orthogonal_columns(A: Float[Array, "*E m n"]) -> tuple[Float[Array, "*E n m"], Float[Array, "*E n n"]]:
    """`(U S)ᵀ` and `Vᵀ` of the singular-value decomposition A = U S Vᵀ: rows in no particular order, the lengths of the
    first one's are the singular values."""
    if isinstance(A, np.ndarray):
        return direct.rotation(A)
    if not _here(A):
        U, S, right = jnp.linalg.svd(A, full_matrices=False)
        return jnp.swapaxes(U * S[..., None, :], -1, -2), right
    return _rotation(A)


@_batched
def _solution(A: Array) -> Array:
    n, m = A.shape[-2:]
    (X,) = _in_lanes(_target(write_solution, 1), A, (n, m - n))
    return X


def solved(S: Float[Array, "*E n n"], B: Float[Array, "*E n k"]) -> Float[Array, "*E n k"]:
    """X of S X = B, S symmetric positive definite."""
    if isinstance(S, np.ndarray):
        return direct.solution(np.concatenate([S, B], axis=-1))
    return _solution(jnp.concatenate([S, B], axis=-1)) if _here(S) else jnp.linalg.solve(S, B)
