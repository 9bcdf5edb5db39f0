"""Rollouts, their tangents, and triangles from NumPy, without a program of XLA's: nothing is compiled for a new shape.

Arrays are laid out in lanes as `rollout_kernel` says; `groups.grouped` makes them so.
"""

from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from .call import MOST_DIRECTIONS, System, machine_code
from .dense_kernel import ROWS, write_rotation, write_solution, write_triangle
from .groups import grouped, ungrouped
from .look_kernel import LOOKED, SEEN, write_costs, write_look
from .machine import function, lanes, loaded
from .remembered import Made, remembered
from .rollout_kernel import ARGUMENTS, TANGENTS, Program
from .threads import over_groups
from .traced import MOST_MODELS, program

Array = np.ndarray
Seen = tuple[Array, Array, Array, Array, Array, Array]
"""`shares` [n, L], `p` [G, P, L], `x` [G, S, L], `u` [G, T, R, U, L], `dt` [G, T, L] s, `fixed` [G, T, D, L]."""


@lru_cache(MOST_MODELS)
def _rollout(system: System, moving: tuple[int, ...] | None, inputs_move: bool = False) -> Callable[..., None]:
    arrays = len(ARGUMENTS) + (len(TANGENTS) if moving is not None else 0) + 1
    return function(machine_code(system, moving, inputs_move), "rollout", 5, arrays)


@lru_cache(MOST_MODELS)
def _costs(system: System) -> Callable[..., None]:
    found = remembered(system.identity, "costs", lambda: Made((loaded(write_costs(_program(system), lanes())),)))
    return function(found.code[0], "costs", 4, len(SEEN) + 1)


@lru_cache(MOST_MODELS)
def _look(system: System, moving: tuple[int, ...], starts: tuple[int, ...]) -> Callable[..., None]:

    def make() -> Made:
        return Made((loaded(write_look(_program(system, moving), starts, lanes())),))

    found = remembered(system.identity, f"look {moving} {starts}", make)
    return function(found.code[0], "look", 5, len(SEEN) + len(LOOKED))


def _program(system: System, moving: tuple[int, ...] | None = None) -> Program:
    return program(system.step, system.output, system.sizes, system.fixed, moving)


@cache
def _dense(write: Callable[[int], Any], results: int) -> Callable[..., None]:
    module = write(lanes())
    return function(loaded(module, rewrite=True), module.name, 3, 1 + results)


def _part(seen: Seen, some: slice) -> Seen:
    """Some of the groups."""
    shares, *rest = seen
    p, x, u, dt, fixed = (array[some] for array in rest)
    return shares, p, x, u, dt, fixed


def outputs(system: System, seen: Seen) -> Float[Array, "G T Y L"]:
    """Outputs of rollouts at every sample. Raises `Untranslated`."""
    shares, _, _, u, _, _ = seen
    G, T, R, _, width = u.shape
    y, code = np.empty((G, T, system.outputs, width)), _rollout(system, None)

    def run(some: slice) -> None:
        code(some.stop - some.start, T, R, 0, len(shares), *_part(seen, some), y[some])

    over_groups(run, G, T * len(shares))
    return y


def squares(
    system: System, seen: Seen, measured: Float[Array, "G T Y L"], weight: Float[Array, "G T Y L"]
) -> Float[Array, "G Y L"]:
    """Sums of squared weighted residuals of rollouts. Raises `Untranslated`."""
    shares, _, _, u, _, _ = seen
    G, T, R, _, width = u.shape
    found, code = np.empty((G, system.outputs, width)), _costs(system)

    def run(some: slice) -> None:
        code(some.stop - some.start, T, R, len(shares), *_part(seen, some), measured[some], weight[some], found[some])

    over_groups(run, G, T * len(shares))
    return found


class Alone(NamedTuple):
    """Directions in which one number moves: the parameters `moving` and the initial states `starts`.

    `by_state` [G, s, L], `by_parameter` [G, n, L]: their units.
    """

    moving: tuple[int, ...]
    starts: tuple[int, ...]
    by_state: Float[Array, "G s L"]
    by_parameter: Float[Array, "G n L"]


_NOTHING = np.zeros(0)


def looked(
    system: System,
    seen: Seen,
    to: Alone,
    measured: Float[Array, "G T Y L"],
    weight: Float[Array, "G T Y L"],
    under: Float[Array, "G N N L"],
) -> tuple[Float[Array, "G N N L"], Float[Array, "G Y L"]]:
    """Triangles of the weighted residuals' derivatives and the residuals, under triangles of other rows, and the residuals'
    squares (`look_kernel`). Raises `Untranslated`."""
    shares, _, _, u, _, _ = seen
    G, T, R, _, width = u.shape
    triangle, sums, N = under.copy(), np.empty((G, system.outputs, width)), under.shape[1]
    look = _look(system, to.moving, to.starts)

    def run(some: slice) -> None:
        block, seen_ = np.empty((N, ROWS, width)), (*_part(seen, some), measured[some], weight[some])
        own = to.by_state[some], to.by_parameter[some], block, triangle[some], sums[some]
        look(some.stop - some.start, T, R, len(shares), 1, *seen_, *own)

    over_groups(run, G, T * len(shares), N)
    return triangle, sums


def rows(
    system: System, seen: Seen, to: Alone, measured: Float[Array, "G T Y L"], weight: Float[Array, "G T Y L"]
) -> Float[Array, "G T Y N L"]:
    """The weighted residuals' derivatives and the residuals. Raises `Untranslated`."""
    shares, _, _, u, _, _ = seen
    G, T, R, _, width = u.shape
    found = np.empty((G, T, system.outputs, len(to.moving) + len(to.starts) + 1, width))
    look, sums = _look(system, to.moving, to.starts), np.empty((G, system.outputs, width))

    def run(some: slice) -> None:
        seen_ = (*_part(seen, some), measured[some], weight[some])
        own = to.by_state[some], to.by_parameter[some], found[some], _NOTHING, sums[some]
        look(some.stop - some.start, T, R, len(shares), 0, *seen_, *own)

    over_groups(run, G, T * len(shares), found.shape[3])
    return found


def tangents(
    system: System, moving: tuple[int, ...], seen: Seen, dp: Float[Array, "G K n L"], dx: Float[Array, "G K S L"]
) -> Float[Array, "G T Y K L"]:
    """Their tangents in K directions of the parameters `moving` and the initial states. Raises `Untranslated`."""
    shares, _, _, u, _, _ = seen
    G, T, R, _, width = u.shape
    parts = []
    for first in range(0, dp.shape[1], MOST_DIRECTIONS):
        some = slice(first, first + MOST_DIRECTIONS)
        own_p, own_x = (np.ascontiguousarray(d[:, some]) for d in (dp, dx))
        K = own_p.shape[1]
        dy, code = np.empty((G, T, system.outputs, K, width)), _rollout(system, moving)
        _moved(code, seen, (own_p, own_x, np.zeros((G, T, R, K, 0, width))), dy)
        parts.append(dy)
    if not parts:
        return np.zeros((G, T, system.outputs, 0, width))
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=3)


def input_tangents(system: System, seen: Seen, du: Float[Array, "G T R K U L"]) -> Float[Array, "G T Y K L"]:
    """Their tangents in K directions of the inputs. Raises `Untranslated`."""
    shares, p, x, u, _, _ = seen
    G, T, R, _, width = u.shape
    parts = []
    for first in range(0, du.shape[3], MOST_DIRECTIONS):
        some = np.ascontiguousarray(du[:, :, :, first : first + MOST_DIRECTIONS])
        K = some.shape[3]
        still = np.zeros((G, K, 0, width)), np.zeros((G, K, x.shape[1], width))
        dy, code = np.empty((G, T, system.outputs, K, width)), _rollout(system, (), True)
        _moved(code, seen, (*still, some), dy)
        parts.append(dy)
    return np.concatenate(parts, axis=3)


def _moved(code: Callable[..., None], seen: Seen, directions: tuple[Array, Array, Array], dy: Array) -> None:
    shares, _, _, u, _, _ = seen
    G, T, R, _, _ = u.shape
    K = dy.shape[3]

    def run(some: slice) -> None:
        own = (*(d[some] for d in directions), dy[some])
        code(some.stop - some.start, T, R, K, len(shares), *_part(seen, some), *own)

    over_groups(run, G, T * len(shares), K)


def triangle(A: Float[Array, "G m n L"]) -> Float[Array, "G n n L"]:
    """The triangle R of A = Q R in every lane, its diagonal not negative (`dense.triangle_of`)."""
    G, m, n, width = A.shape
    R = np.empty((G, n, n, width))
    _dense(write_triangle, 1)(G, m, n, A, R)
    return R


def triangles(A: Float[Array, "*E m n"]) -> Float[Array, "*E n n"]:
    """The triangles of many matrices; of a single one, however tall."""
    if A.ndim == 2:
        return one_triangle(A)
    flat = A.reshape(-1, *A.shape[-2:])
    return ungrouped(triangle(grouped(flat)), len(flat)).reshape(*A.shape[:-2], A.shape[-1], A.shape[-1])


def solution(A: Float[Array, "*E n m"]) -> Float[Array, "*E n k"]:
    """X of S X = B, S symmetric positive definite, where A is S beside B (`dense.solved`)."""
    n, m = A.shape[-2:]
    flat = grouped(A.reshape(-1, n, m))
    X = np.empty((len(flat), n, m - n, lanes()))
    _dense(write_solution, 1)(len(flat), n, m, flat, X)
    return ungrouped(X, int(np.prod(A.shape[:-2]))).reshape(*A.shape[:-1], m - n)


def rotation(A: Float[Array, "m n"]) -> tuple[Float[Array, "n m"], Float[Array, "n n"]]:
    """`(U S)ᵀ` and `Vᵀ` of A = U S Vᵀ (`dense.orthogonal_columns`)."""
    m, n = A.shape
    B, V = np.empty((1, n, m, lanes())), np.empty((1, n, n, lanes()))
    _dense(write_rotation, 2)(1, m, n, grouped(A[None]), B, V)
    return B[0, :, :, 0], V[0, :, :, 0]


def one_triangle(A: Float[Array, "m n"]) -> Float[Array, "n n"]:
    """The triangle of one matrix, however tall: of its parts in lanes, and then of their triangles."""
    m, n = A.shape
    if m > 2 * lanes() * n:
        part = -(-m // lanes())
        A = np.concatenate([A, np.zeros((part * lanes() - m, n))])
        A = ungrouped(triangle(grouped(A.reshape(lanes(), part, n))), lanes()).reshape(lanes() * n, n)
    return triangle(grouped(A[None]))[0, :, :, 0]
