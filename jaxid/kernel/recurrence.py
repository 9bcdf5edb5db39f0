"""Recurrences along a record as one operation of JAX's each: a loop in XLA, machine code from NumPy.

Written as `jax.lax.scan` they could not be run in NumPy in reasonable time; written as log2(T) operations on whole arrays they
take XLA a second to compile.
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Float

from .expressions import Graph, Node
from .identity import identity_of
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


def limited(
    wanted: Float[Array, " T *n"], away: Float[Array, "#T *#n"], back: Float[Array, "#T *#n"] | None = None
) -> Float[jax.Array, " T *n"]:
    """`x[t]` as near to `wanted[t]` as steps get it that grow |x| by at most `away[t]` and shrink it by at most `back[t]`
    (default: as much); from zero. A step through zero spends on the second half what the first leaves of it."""
    wanted = jnp.asarray(wanted)
    away = jnp.broadcast_to(away, wanted.shape)
    return limited_p.bind(wanted, away, away if back is None else jnp.broadcast_to(back, wanted.shape))


def approached(
    wanted: Float[Array, " T *n"], away: Float[Array, "#T *#n"], back: Float[Array, "#T *#n"]
) -> Float[jax.Array, " T *n"]:
    """`x[t]` on the way from `x[t - 1]` to `wanted[t]`, of which a step leaves exp(-away[t]) where |x| grows and exp(-back[t])
    where it shrinks; from zero. A step through zero leaves of the second half what the first has not used up of the step."""
    wanted = jnp.asarray(wanted)
    return approached_p.bind(wanted, jnp.broadcast_to(away, wanted.shape), jnp.broadcast_to(back, wanted.shape))


def saturated(
    wanted: Float[Array, " T *n"], share: Float[Array, "#T *#n"], most: Float[Array, "#T *#n"]
) -> Float[jax.Array, " T *n"]:
    """`x[t]` on the way from `x[t - 1]` to `wanted[t]` as a servo goes: at a speed in proportion to what is left, of which a
    step would leave exp(-share[t]), but by `most[t]` at most; from zero."""
    wanted = jnp.asarray(wanted)
    return saturated_p.bind(wanted, jnp.broadcast_to(share, wanted.shape), jnp.broadcast_to(most, wanted.shape))


def clipped(low: Float[Array, " T *n"], high: Float[Array, " T *n"]) -> Float[jax.Array, " T *n"]:
    """`x[t]` as near to `x[t - 1]` as lies between `low[t]` and `high[t]`, low <= high; from zero: the play operator."""
    return clipped_p.bind(*jnp.broadcast_arrays(low, high))


@cache
def _code(name: str, after: Callable[..., Node], parts: int) -> Map:
    """`after` (of the last value and of the `parts` of a row) along rows."""

    def make() -> list[Mapped]:
        graph = Graph()
        row, (x,) = (scalars(inputs(graph, group, count)) for group, count in (("row", parts), ("carried", 1)))
        result = after(graph, x, *row)
        return [Mapped(graph, parts, [result], [result])]

    return compiled_maps(identity_of(name), "all columns", make)[0]


def _along(name: str, after: Callable[..., Node], *parts: np.ndarray):
    """In machine code, from zero, along the first axis of arrays [T, ...]."""
    one, *_ = parts = tuple(np.broadcast_arrays(*parts))
    T, columns = len(one), one.size // max(1, len(one))
    rows = np.stack([part.reshape(T, columns) for part in parts], axis=-1)
    found = _code(name, after, len(parts))(np.zeros(0), rows.transpose(1, 0, 2), np.zeros((columns, 1)))
    return found[:, :, 0].T.reshape(one.shape)


def _kept_and_new(graph: Graph, x: Node, keep: Node, new: Node) -> Node:
    return graph.add(graph.mul(keep, x), new)


def _farthest_up(graph: Graph, x: Node, away: Node, back: Node) -> Node:
    zero = graph.constant(0.0)
    left = graph.add(graph.apply("min", x, zero), back)
    through = graph.mul(graph.apply("max", left, zero), graph.div(away, back))
    return graph.add(graph.add(graph.apply("max", x, zero), graph.apply("min", left, zero)), through)


def _near_and_no_farther(graph: Graph, x: Node, wanted: Node, away: Node, back: Node) -> Node:
    high = _farthest_up(graph, x, away, back)
    low = graph.neg(_farthest_up(graph, graph.neg(x), away, back))
    return graph.apply("min", graph.apply("max", wanted, low), high)


def _part_of_the_way(graph: Graph, x: Node, wanted: Node, away: Node, back: Node) -> Node:
    zero, one = graph.constant(0.0), graph.constant(1.0)
    crosses = graph.apply("lt", graph.mul(x, wanted), zero)
    gap = graph.sub(x, wanted)
    share = graph.select(crosses, one, graph.neg(graph.div(wanted, graph.select(crosses, one, gap))))
    used = graph.neg(graph.apply("log", share))
    left = graph.apply("max", graph.sub(one, graph.div(used, back)), zero)
    through = graph.mul(wanted, graph.sub(one, graph.apply("exp", graph.neg(graph.mul(away, left)))))
    grows = graph.apply("lt", graph.apply("abs", x), graph.apply("abs", wanted))
    rate = graph.select(crosses, graph.select(grows, back, away), back)
    plain = graph.add(wanted, graph.mul(gap, graph.apply("exp", graph.neg(rate))))
    return graph.select(crosses, plain, graph.select(graph.apply("lt", used, back), plain, through))


def _left_of_the_way(graph: Graph, x: Node, wanted: Node, share: Node, most: Node) -> Node:
    zero, one = graph.constant(0.0), graph.constant(1.0)
    gap = graph.sub(wanted, x)
    size, band = graph.apply("abs", gap), graph.div(most, share)
    first = graph.apply("min", graph.apply("max", graph.div(graph.sub(size, band), most), zero), one)
    slowly = graph.apply("exp", graph.neg(graph.mul(share, graph.sub(one, first))))
    left = graph.mul(graph.sub(size, graph.mul(most, first)), slowly)
    return graph.sub(wanted, graph.select(graph.apply("lt", gap, zero), left, graph.neg(left)))


def _nearest_between(graph: Graph, x: Node, low: Node, high: Node) -> Node:
    return graph.apply("min", graph.apply("max", x, low), high)


def recurrence_in_numpy(keep: np.ndarray, new: np.ndarray) -> np.ndarray:
    """From zero, in machine code; `keep` and `new` [T, ...]."""
    return _along("recurrence", _kept_and_new, keep, new)


def limited_in_numpy(wanted: np.ndarray, away: np.ndarray, back: np.ndarray) -> np.ndarray:
    """The same of limited steps."""
    return _along("limited", _near_and_no_farther, wanted, away, back)


def approached_in_numpy(wanted: np.ndarray, away: np.ndarray, back: np.ndarray) -> np.ndarray:
    """The same of parts of the way."""
    return _along("approached", _part_of_the_way, wanted, away, back)


def saturated_in_numpy(wanted: np.ndarray, share: np.ndarray, most: np.ndarray) -> np.ndarray:
    """The same of a servo's way."""
    return _along("saturated", _left_of_the_way, wanted, share, most)


def clipped_in_numpy(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The same of what is kept between two bounds."""
    return _along("clipped", _nearest_between, low, high)


def _recurring(keep, new):
    def advance(x, row):
        x = row[0] * x + row[1]
        return x, x

    return jax.lax.scan(advance, jnp.zeros_like(new[0]), (keep, new))[1]


def _looped(step: Callable[..., Any], *values):
    """`step` (of the last value and of a row: the next value and its derivatives) along rows, from zero."""

    def advance(x, row):
        x, _ = step(x, *row)
        return x, x

    return jax.lax.scan(advance, jnp.zeros_like(values[0][0]), values)[1]


def _up_from(x, away, back):
    """How far up a step gets from `x`, and its derivatives by the three."""
    left = jnp.minimum(x, 0.0) + back
    through, ratio = left > 0.0, away / back
    after = jnp.maximum(x, 0.0) + jnp.where(through, left * ratio, left)
    by_left = jnp.where(through, ratio, 1.0)
    by_away = jnp.where(through, left / back, 0.0)
    return after, (jnp.where(x < 0.0, by_left, 1.0), by_away, by_left - by_away * ratio)


def _limit(x, wanted, away, back):
    """Where a step gets from `x`, and its derivatives by the four."""
    sign = jnp.sign(wanted - x)
    up, (by_x, by_away, by_back) = _up_from(sign * x, away, back)
    short = sign * wanted > up
    after = jnp.where(short, sign * up, wanted)
    return after, (
        jnp.where(short, by_x, 0.0), jnp.where(short, 0.0, 1.0), jnp.where(short, sign * by_away, 0.0),
        jnp.where(short, sign * by_back, 0.0),
    )  # fmt: skip


def _on_the_way(x, wanted, away, back):
    """Where a step gets from `x`, and its derivatives by the four."""
    crosses, gap = x * wanted < 0.0, x - wanted
    length = jnp.where(crosses, gap, 1.0)
    used = -jnp.log(jnp.where(crosses, -wanted / length, 1.0))
    passes = crosses & (used < back)
    left = jnp.where(passes, 1.0 - used / back, 0.0)
    rest = jnp.exp(-away * left)
    grows = ~crosses & (jnp.abs(x) < jnp.abs(wanted))
    keep = jnp.exp(-jnp.where(grows, away, back))
    after = jnp.where(passes, wanted * (1.0 - rest), wanted + gap * keep)
    # Through zero, what is used up hangs on how far either is from there.
    by_left = wanted * away * rest
    own = wanted * length
    by_used = -by_left / back
    by_x = jnp.where(passes, by_used / length, keep)
    by_wanted = jnp.where(passes, 1.0 - rest + by_used * -x / jnp.where(passes, own, 1.0), 1.0 - keep)
    by_away = jnp.where(passes, wanted * left * rest, jnp.where(grows, -gap * keep, 0.0))
    by_back = jnp.where(passes, by_left * used / back**2, jnp.where(grows, 0.0, -gap * keep))
    return after, (by_x, by_wanted, by_away, by_back)


def _as_a_servo(x, wanted, share, most):
    """Where a step gets from `x`, and its derivatives by the four."""
    gap = wanted - x
    size, sign, band = jnp.abs(gap), jnp.sign(gap), most / share
    first = jnp.clip((size - band) / most, 0.0, 1.0)
    slowly = jnp.exp(-share * (1.0 - first))
    left = (size - most * first) * slowly
    full, near = first >= 1.0, first <= 0.0
    # Of what is left: while it goes at full speed nothing but how far it gets matters.
    by_size = jnp.where(full, 1.0, jnp.where(near, slowly, left / band))
    by_share = jnp.where(full, 0.0, -left * (1.0 - first))
    by_most = jnp.where(full, -1.0, jnp.where(near, 0.0, left / most * (1.0 - size / band)))
    return wanted - sign * left, (by_size, 1.0 - by_size, -sign * by_share, -sign * by_most)


def _clip(x, low, high):
    """Where a step gets from `x`, and its derivatives by the three."""
    below, above = x < low, x > high
    within = ~(below | above)
    return jnp.clip(x, low, high), tuple(jnp.where(which, 1.0, 0.0) for which in (within, below, above))


def _before(x):
    return jnp.concatenate([jnp.zeros_like(x[:1]), x[:-1]])


def _recurring_moved(values, tangents):
    keep, new = values
    d_keep, d_new = tangents
    x = recurrence_p.bind(keep, new)
    parts = [] if isinstance(d_new, ad.Zero) else [d_new]
    if not isinstance(d_keep, ad.Zero):
        parts.append(d_keep * _before(x))
    return x, recurrence_p.bind(keep, sum(parts)) if parts else ad.Zero(x.aval)


def _moved(made: Primitive, step: Callable[..., Any], values, tangents):
    """A change of what comes in is a recurrence, too: of what a step keeps of the change so far."""
    x = made.bind(*values)
    by_x, *by = step(_before(x), *values)[1]
    new = [slope * d for slope, d in zip(by, tangents, strict=True) if not isinstance(d, ad.Zero)]
    return x, recurrence_p.bind(by_x, sum(new)) if new else ad.Zero(x.aval)


def _recurring_transposed(cotangent, keep, new):
    if isinstance(cotangent, ad.Zero):
        return None, ad.Zero(new.aval)
    later = jnp.flip(jnp.concatenate([keep[1:], jnp.zeros_like(keep[:1])]), 0)
    return None, jnp.flip(recurrence_p.bind(later, jnp.flip(cotangent, 0)), 0)


def _batched(primitive, values, axes):
    size = next(v.shape[axis] for v, axis in zip(values, axes, strict=True) if axis is not None)
    wide = [
        jnp.broadcast_to(v[..., None], (*v.shape, size)) if axis is None else jnp.moveaxis(v, axis, -1)
        for v, axis in zip(values, axes, strict=True)
    ]
    return primitive.bind(*wide), wide[0].ndim - 1


def _primitive(name: str, looped: Callable[..., Any]) -> Primitive:
    made = Primitive(name)
    made.def_impl(jax.jit(looped))
    made.def_abstract_eval(lambda *parts: parts[0])
    batching.primitive_batchers[made] = partial(_batched, made)
    mlir.register_lowering(made, mlir.lower_fun(looped, multiple_results=False))
    return made


def _of_steps(name: str, step: Callable[..., Any]) -> Primitive:
    made = _primitive(name, partial(_looped, step))
    ad.primitive_jvps[made] = partial(_moved, made, step)
    return made


recurrence_p = _primitive("recurrence", _recurring)
ad.primitive_jvps[recurrence_p] = _recurring_moved
ad.primitive_transposes[recurrence_p] = _recurring_transposed
limited_p = _of_steps("limited", _limit)
approached_p = _of_steps("approached", _on_the_way)
saturated_p = _of_steps("saturated", _as_a_servo)
clipped_p = _of_steps("clipped", _clip)
