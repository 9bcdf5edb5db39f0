"""JAX functions of whole arrays run in NumPy, one operation after another: nothing is compiled for another shape.

For functions that are called a few times on each shape and consist of a few hundred operations on arrays, such as a delay of
logged commands: tracing one takes some ten milliseconds, where XLA takes a second to compile it.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, SupportsIndex

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Literal
from jax.lax import GatherScatterMode

from .places import stamps_before_in_numpy
from .recurrence import (
    approached_in_numpy,
    clipped_in_numpy,
    limited_in_numpy,
    recurrence_in_numpy,
    saturated_in_numpy,
)
from .symbolic import MOST_UNROLLED, Untranslated, loop_sizes

Array = np.ndarray
_OVERHEAD, _EACH = 8e-6, 2e-9
"""Seconds of an operation, and of each of the numbers that it makes."""
Operation = Callable[..., Sequence[Array]]


def _quotient(a: Array, b: Array) -> Array:
    """Of whole numbers: towards zero."""
    if not np.issubdtype(np.result_type(a), np.integer):
        return np.divide(a, b)
    return a // b + ((a % b != 0) & ((a < 0) != (b < 0)))


_PLAIN: dict[str, Callable[..., Any]] = {
    "add": np.add, "add_any": np.add, "sub": np.subtract, "mul": np.multiply, "div": _quotient, "neg": np.negative,
    "max": np.maximum, "min": np.minimum, "abs": np.abs, "floor": np.floor, "ceil": np.ceil, "sqrt": np.sqrt,
    "exp": np.exp, "log": np.log, "log1p": np.log1p, "expm1": np.expm1, "tanh": np.tanh, "sin": np.sin, "cos": np.cos,
    "tan": np.tan, "sinh": np.sinh, "cosh": np.cosh, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
    "atan2": np.arctan2, "pow": np.power, "sign": np.sign, "square": np.square, "is_finite": np.isfinite,
    "lt": np.less, "le": np.less_equal, "gt": np.greater, "ge": np.greater_equal, "eq": np.equal, "ne": np.not_equal,
    "lt_to": np.less, "le_to": np.less_equal, "and": np.logical_and, "or": np.logical_or, "not": np.logical_not,
    "stop_gradient": np.asarray, "copy": np.asarray, "copy_p": np.asarray, "optimization_barrier": np.asarray,
    "recurrence": recurrence_in_numpy, "limited": limited_in_numpy, "rem": np.fmod,
    "approached": approached_in_numpy, "saturated": saturated_in_numpy, "clipped": clipped_in_numpy,
    "stamps_before": stamps_before_in_numpy,
    "rsqrt": lambda x: 1.0 / np.sqrt(x),
    "logistic": lambda x: 1.0 / (1.0 + np.exp(-x)),
    "clamp": lambda low, x, high: np.minimum(np.maximum(x, low), high),
}  # fmt: skip
_SHAPED: dict[str, Callable[..., Callable[..., Any]]] = {
    "integer_pow": lambda y: lambda x: np.asarray(x) ** y if y >= 0 else 1.0 / np.asarray(x) ** -y,
    "convert_element_type": lambda new_dtype: lambda x: np.asarray(x).astype(new_dtype),
    "broadcast_in_dim": lambda shape, broadcast_dimensions: (
        lambda x: np.broadcast_to(np.reshape(x, _spread(np.shape(x), len(shape), broadcast_dimensions)), shape)
    ),
    "round": lambda rounding_method: np.rint if int(rounding_method) else lambda x: np.trunc(x + np.copysign(0.5, x)),
    "reshape": lambda new_sizes: lambda x: np.reshape(x, new_sizes),
    "squeeze": lambda dimensions: lambda x: np.squeeze(x, tuple(dimensions)),
    "expand_dims": lambda dimensions: lambda x: np.expand_dims(x, tuple(dimensions)),
    "transpose": lambda permutation: lambda x: np.transpose(x, permutation),
    "rev": lambda dimensions: lambda x: np.flip(x, tuple(dimensions)),
    "tile": lambda reps: lambda x: np.tile(x, reps),
    "concatenate": lambda dimension: lambda *parts: np.concatenate(parts, axis=dimension),
    "stack": lambda axis: lambda *parts: np.stack(parts, axis=axis),
    "reduce_sum": lambda axes: lambda x: np.sum(x, axis=tuple(axes)),
    "reduce_max": lambda axes: lambda x: np.max(x, axis=tuple(axes)),
    "reduce_min": lambda axes: lambda x: np.min(x, axis=tuple(axes)),
    "reduce_and": lambda axes: lambda x: np.all(x, axis=tuple(axes)),
    "reduce_or": lambda axes: lambda x: np.any(x, axis=tuple(axes)),
    "cumsum": lambda axis, reverse: lambda x: _along(np.cumsum, x, axis, reverse),
    "cumprod": lambda axis, reverse: lambda x: _along(np.cumprod, x, axis, reverse),
    "cummax": lambda axis, reverse: lambda x: _along(np.maximum.accumulate, x, axis, reverse),
    "cummin": lambda axis, reverse: lambda x: _along(np.minimum.accumulate, x, axis, reverse),
    "slice": lambda start_indices, limit_indices, strides: (
        lambda x: x[tuple(map(slice, start_indices, limit_indices, strides or [1] * len(start_indices)))]
    ),
}
"""By the parameters of the primitive."""
_CALLS = {"jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call", "remat", "checkpoint"}


def _spread(shape: Sequence[int], axes: int, places: Sequence[SupportsIndex]) -> list[int]:
    wide = [1] * axes
    for size, place in zip(shape, places, strict=True):
        wide[place] = size
    return wide


def _along(accumulate: Callable[..., Array], x: Array, axis: int, reverse: bool) -> Array:
    return np.flip(accumulate(np.flip(x, axis), axis=axis), axis) if reverse else accumulate(x, axis=axis)


def _select(which: Array, *cases: Array) -> Array:
    if len(cases) == 2:
        return np.where(which, cases[1], cases[0])
    return np.choose(which, cases)


def _pad(x: Array, filling: Array, config: Sequence[tuple[int, int, int]]) -> Array:
    shape = [low + n + max(0, n - 1) * between + high for n, (low, high, between) in zip(x.shape, config, strict=True)]
    padded = np.full(shape, filling)
    own = [slice(low, low + n + max(0, n - 1) * b, 1 + b) for n, (low, _, b) in zip(x.shape, config, strict=True)]
    padded[tuple(own)] = x
    return padded


def _gather(shape: Sequence[int], found: Sequence[int], params: dict[str, Any]) -> Callable[[Array, Array], Array]:
    """`jax.lax.gather` from an array of this `shape`, with results of the shape `found`: slices at places; those that are not
    all in the array are moved into it or, by the mode, not a number."""
    numbers, sizes = params["dimension_numbers"], params["slice_sizes"]
    strides = np.cumprod([1, *shape[:0:-1]])[::-1]
    batch = [k for k in range(len(found)) if k not in numbers.offset_dims]
    kept = [d for d in range(len(shape)) if d not in {*numbers.collapsed_slice_dims, *numbers.operand_batching_dims}]
    from_axis = dict(zip(kept, numbers.offset_dims, strict=True))
    from_axis |= {
        d: batch[k] for d, k in zip(numbers.operand_batching_dims, numbers.start_indices_batching_dims, strict=True)
    }
    base = np.zeros([1] * len(found), np.int64)
    for d, axis in from_axis.items():
        base = base + strides[d] * np.arange(found[axis]).reshape([-1 if k == axis else 1 for k in range(len(found))])
    trusted, filled = (
        params["mode"] == mode for mode in (GatherScatterMode.PROMISE_IN_BOUNDS, GatherScatterMode.FILL_OR_DROP)
    )
    filling = np.nan if params["fill_value"] is None else params["fill_value"]
    wide = [1 if k in numbers.offset_dims else found[k] for k in range(len(found))]

    def gather(x: Array, places: Array) -> Array:
        flat, outside = base, np.zeros(wide, bool)
        for k, d in enumerate(numbers.start_index_map):
            at = places[..., k].reshape(wide)
            inside = at if trusted else np.clip(at, 0, shape[d] - sizes[d])
            flat = flat + strides[d] * inside
            outside = outside if trusted else outside | (inside != at)
        picked = np.broadcast_to(np.ravel(x)[flat], found)
        return np.where(outside, filling, picked) if filled else picked

    return gather


def _product(a: Array, b: Array, dimension_numbers: Any) -> Array:
    (ca, cb), (ba, bb) = dimension_numbers
    if ba or bb:
        raise Untranslated("a batched product of matrices")
    return np.tensordot(a, b, (tuple(ca), tuple(cb)))


class _Loop(NamedTuple):
    """A scan, turn by turn."""

    body: "Steps"
    fixed: int
    carried: int
    length: int
    backwards: bool

    def __call__(self, *inputs: Array) -> list[Array]:
        fixed, carry = inputs[: self.fixed], list(inputs[self.fixed : self.fixed + self.carried])
        rows, stacked = inputs[self.fixed + self.carried :], []
        turns = range(self.length)
        for i in reversed(turns) if self.backwards else turns:
            results = self.body(*fixed, *carry, *(row[i] for row in rows))
            carry = results[: self.carried]
            stacked.append(results[self.carried :])
        if self.backwards:
            stacked.reverse()
        return [*carry, *(np.stack(each) for each in zip(*stacked, strict=True))]


def _loop(equation: Any) -> _Loop:
    params = equation.params
    if params["length"] > MOST_UNROLLED:
        raise Untranslated(f"an inner loop of {params['length']} turns")
    return _Loop(steps_of(params["jaxpr"]), *loop_sizes(equation), params["length"], params["reverse"])


def _operation(equation: Any) -> Operation:
    """What the equation does, as a function of its inputs. Raises `Untranslated`."""
    name, params = equation.primitive.name, equation.params
    if name in {"and", "or", "not"} and equation.invars[0].aval.dtype != bool:
        raise Untranslated(f"the primitive {name!r} of whole numbers")
    if name in _PLAIN:
        return _one(_PLAIN[name])
    if name in _SHAPED:
        make = _SHAPED[name]
        asked = make.__code__.co_varnames[: make.__code__.co_argcount]
        return _one(make(**{key: params[key] for key in asked}))
    if name == "select_n":
        return _one(_select)
    if name == "pad" and all(low >= 0 and high >= 0 for low, high, _ in params["padding_config"]):
        return _one(lambda x, filling: _pad(x, filling, params["padding_config"]))
    if name == "gather" and np.issubdtype(equation.invars[0].aval.dtype, np.floating):
        return _one(_gather(equation.invars[0].aval.shape, equation.outvars[0].aval.shape, params))
    if name == "dot_general":
        return _one(lambda a, b: _product(a, b, params["dimension_numbers"]))
    if name == "iota":
        shape = [-1 if d == params["dimension"] else 1 for d in range(len(params["shape"]))]
        row = np.arange(params["shape"][params["dimension"]], dtype=params["dtype"]).reshape(shape)
        return lambda: [np.broadcast_to(row, params["shape"])]
    if name == "scan":
        return _loop(equation)
    raise Untranslated(f"the primitive {name!r}")


def _one(function: Callable[..., Any]) -> Operation:
    return lambda *inputs: [function(*inputs)]


class Steps(NamedTuple):
    """Operations one after another on numbered values: each with the numbers of its inputs and results, and those that
    nothing reads any more."""

    known: dict[int, Array]
    inputs: tuple[int, ...]
    steps: tuple[tuple[Operation, tuple[int, ...], tuple[int, ...], tuple[int, ...]], ...]
    results: tuple[int, ...]
    seconds: float
    """What a run takes, about: counted, not measured, so that whoever decides by it decides alike every time."""

    def __call__(self, *values: Any) -> list[Array]:
        held: dict[int, Any] = dict(self.known)
        held.update(zip(self.inputs, values, strict=True))
        with np.errstate(all="ignore"):  # what a `where` leaves out may be anything
            for operation, read, made, done in self.steps:
                held.update(zip(made, operation(*[held[i] for i in read]), strict=True))
                for i in done:
                    del held[i]
        return [held[i] for i in self.results]


def steps_of(closed: ClosedJaxpr) -> Steps:
    """A jaxpr as operations of NumPy's, without those that no result needs. Raises `Untranslated`."""
    known: dict[int, Array] = {}
    written: list[tuple[Any, tuple[int, ...], tuple[int, ...]]] = []
    count = iter(range(10**9))

    def constant(value: Any) -> int:
        known[number := next(count)] = np.asarray(value)
        return number

    def unfold(jaxpr: Any, consts: Sequence[Any], given: Sequence[int]) -> list[int]:
        numbers: dict[Any, int] = dict(zip(jaxpr.invars, given, strict=True))
        numbers.update({v: constant(c) for v, c in zip(jaxpr.constvars, consts, strict=True)})

        def of(atom: Any) -> int:
            return constant(atom.val) if isinstance(atom, Literal) else numbers[atom]

        for equation in jaxpr.eqns:
            read = [of(atom) for atom in equation.invars]
            if equation.primitive.name in _CALLS:
                inner = equation.params.get("jaxpr") or equation.params["call_jaxpr"]
                made = unfold(getattr(inner, "jaxpr", inner), getattr(inner, "consts", ()), read)
            else:
                made = [next(count) for _ in equation.outvars]
                written.append((equation, tuple(read), tuple(made)))
            numbers.update(zip(equation.outvars, made, strict=True))
        return [of(atom) for atom in jaxpr.outvars]

    inputs = [next(count) for _ in closed.jaxpr.invars]
    results = unfold(closed.jaxpr, closed.consts, inputs)
    needed, steps, seconds = set(results), [], 0.0
    for equation, read, made in reversed(written):
        if needed.isdisjoint(made):
            continue
        done = tuple({i for i in read if i not in needed and i not in known})
        unread = tuple(i for i in made if i not in needed)
        needed.update(read)
        operation = _operation(equation)
        steps.append((operation, read, made, done + unread))
        seconds += _OVERHEAD + _EACH * sum(math.prod(result.aval.shape) for result in equation.outvars)
        if isinstance(operation, _Loop):
            seconds += operation.length * operation.body.seconds
    own = {i: known[i] for i in known if i in needed}
    return Steps(own, tuple(inputs), tuple(reversed(steps)), tuple(results), seconds)


def in_numpy(function: Callable[..., Any], *arguments: Any) -> Steps:
    """`function`, which returns one array, as operations on arrays of the shapes of the `arguments`. Raises `Untranslated`."""
    return steps_of(jax.make_jaxpr(function)(*arguments))
