"""A JAX function of small arrays as scalar expressions: its jaxpr is run on numbers of expressions."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal, jaxpr_as_fun

from .expressions import Graph, Node

MOST_UNROLLED = 64
"""Turns of an inner loop that are written out; a longer one is left to XLA."""


class Untranslated(Exception):
    """The function uses something that has no translation; XLA can run it all the same."""


Values = np.ndarray
"""Expressions by number, in an object array of the shape that the JAX value has."""

_BINARY = {"add": "add", "add_any": "add", "sub": "sub", "mul": "mul", "div": "div"}
_PLAIN = {
    "max": "max", "min": "min", "abs": "abs", "floor": "floor", "round": "round", "sqrt": "sqrt", "exp": "exp",
    "log": "log", "tanh": "tanh", "sin": "sin", "cos": "cos", "lt": "lt", "le": "le", "gt": "gt", "ge": "ge",
    "eq": "eq", "ne": "ne", "and": "and", "or": "or", "not": "not", "pow": "pow", "atan2": "atan2", "log1p": "log1p",
    "expm1": "expm1", "is_finite": "is_finite", "sign": "sign",
}  # fmt: skip


def _leg(graph: Graph, x: Node) -> Node:
    """sqrt(1 - x²), right next to ± 1 as well."""
    one = graph.constant(1.0)
    return graph.apply("sqrt", graph.mul(graph.sub(one, x), graph.add(one, x)))


def _sinh(graph: Graph, x: Node) -> Node:
    """Through exp(x) - 1, which keeps its digits at small arguments."""
    grown = graph.apply("expm1", x)
    both = graph.add(grown, graph.div(grown, graph.add(grown, graph.constant(1.0))))
    return graph.mul(graph.constant(0.5), both)


def _cosh(graph: Graph, x: Node) -> Node:
    up, down = graph.apply("exp", x), graph.apply("exp", graph.neg(x))
    return graph.mul(graph.constant(0.5), graph.add(up, down))


_MADE: dict[str, Callable[..., Node]] = {
    "tan": lambda graph, x: graph.div(graph.apply("sin", x), graph.apply("cos", x)),
    "atan": lambda graph, x: graph.apply("atan2", x, graph.constant(1.0)),
    "asin": lambda graph, x: graph.apply("atan2", x, _leg(graph, x)),
    "acos": lambda graph, x: graph.apply("atan2", _leg(graph, x), x),
    "sinh": _sinh,
    "cosh": _cosh,
}
"""Functions that are made of others."""
_SAME = {"copy", "copy_p", "stop_gradient", "optimization_barrier"}
_SHAPES = {"broadcast_in_dim", "reshape", "squeeze", "slice", "concatenate", "transpose", "expand_dims", "rev", "stack"}
_CALLS = {"jit", "pjit", "closed_call", "core_call", "custom_vjp_call", "remat", "checkpoint"}


def _array(values: Sequence[Any], shape: tuple[int, ...]) -> Values:
    result = np.empty(len(values), dtype=object)
    result[:] = list(values)
    return result.reshape(shape)


def _each(function: Callable[..., Node], *values: Values) -> Values:
    """`function` of the elements, scalars stretched."""
    wide = np.broadcast_arrays(*values)
    return _array([function(*row) for row in zip(*(w.ravel() for w in wide), strict=True)], wide[0].shape)


def constants(graph: Graph, value: Any) -> Values:
    """A known array as expressions."""
    array = np.asarray(value)
    return _array([graph.constant(x) for x in array.ravel().tolist()], array.shape)


def _reshaped(equation: Any, inputs: Sequence[Values]) -> Values:
    """Operations that only move elements, carried out by JAX itself on the elements' positions."""
    sizes = np.cumsum([0, *(x.size for x in inputs)])
    places = [
        np.arange(a, b, dtype=np.int64).reshape(x.shape) for a, b, x in zip(sizes, sizes[1:], inputs, strict=False)
    ]
    with jax.ensure_compile_time_eval():  # the caller may be tracing a program of its own
        moved = np.asarray(equation.primitive.bind(*places, **equation.params))
    flat = np.concatenate([x.ravel() for x in inputs])
    return _array([flat[i] for i in moved.ravel()], moved.shape)


def _contract(graph: Graph, equation: Any, a: Values, b: Values) -> Values:
    (ca, cb), (ba, bb) = equation.params["dimension_numbers"]
    if ba or bb:
        raise Untranslated("a batched product of matrices")
    a, b = np.moveaxis(a, ca, range(len(ca))), np.moveaxis(b, cb, range(len(cb)))
    k = int(np.prod(a.shape[: len(ca)], dtype=int))
    left, right = a.reshape(k, -1), b.reshape(k, -1)
    out = []
    for i in range(left.shape[1]):
        for j in range(right.shape[1]):
            total = graph.constant(0.0)
            for m in range(k):
                total = graph.add(total, graph.mul(left[m, i], right[m, j]))
            out.append(total)
    return _array(out, a.shape[len(ca) :] + b.shape[len(cb) :])


def _equation(graph: Graph, equation: Any, inputs: Sequence[Values]) -> list[Values]:
    name, params = equation.primitive.name, equation.params
    if name in _BINARY:
        return [_each(getattr(graph, _BINARY[name]), *inputs)]
    if name == "neg":
        return [_each(graph.neg, *inputs)]
    if name == "integer_pow":
        return [_each(lambda x: graph.power(x, params["y"]), *inputs)]
    if name == "square":
        return [_each(lambda x: graph.mul(x, x), *inputs)]
    if name == "logistic":
        one = graph.constant(1.0)
        return [_each(lambda x: graph.div(one, graph.add(one, graph.apply("exp", graph.neg(x)))), *inputs)]
    if name == "rsqrt":
        return [_each(lambda x: graph.div(graph.constant(1.0), graph.apply("sqrt", x)), *inputs)]
    if name == "clamp":
        low, x, high = inputs
        return [_each(lambda lo, v, hi: graph.apply("min", graph.apply("max", v, lo), hi), low, x, high)]
    if name == "select_n" and len(inputs) == 3:
        return [_each(graph.select, *inputs)]
    if name in _MADE:
        return [_each(partial(_MADE[name], graph), *inputs)]
    if name in _PLAIN:
        return [_each(lambda *x: graph.apply(_PLAIN[name], *x), *inputs)]
    if name in _SAME:
        return list(inputs)
    if name == "convert_element_type":
        return [_converted(graph, equation.invars[0].aval.dtype, params["new_dtype"], inputs[0])]
    if name in _SHAPES:
        return [_reshaped(equation, inputs)]
    if not inputs and not equation.effects:  # a table of numbers, such as iota
        with jax.ensure_compile_time_eval():
            return [constants(graph, equation.primitive.bind(**params))]
    if name == "reduce_sum":
        x = np.moveaxis(inputs[0], params["axes"], range(len(params["axes"])))
        rows = x.reshape(-1, *x.shape[len(params["axes"]) :])
        total = constants(graph, np.zeros(rows.shape[1:]))
        for k in range(len(rows)):
            total = _each(graph.add, total, rows[k, ...])
        return [total]
    if name == "dot_general":
        return [_contract(graph, equation, *inputs)]
    if name == "scan":
        return _scan(graph, equation, inputs)
    if name == "custom_jvp_call":
        return _with_own_rule(graph, equation, inputs)
    if name in _CALLS:
        inner = params.get("jaxpr") or params.get("call_jaxpr")
        return run(graph, inner, inputs)
    raise Untranslated(f"the primitive {name!r}")


def _converted(graph: Graph, before: Any, after: Any, x: Values) -> Values:
    """Truth values are numbers 0 and 1 where numbers are wanted, and whole numbers are numbers without a fraction."""
    was_true, is_true = (np.issubdtype(kind, np.bool_) for kind in (before, after))
    if was_true and not is_true:
        return _each(lambda v: graph.select(v, graph.constant(0.0), graph.constant(1.0)), x)
    if is_true and not was_true:
        return _each(lambda v: graph.apply("ne", v, graph.constant(0.0)), x)
    if np.issubdtype(after, np.integer) and np.issubdtype(before, np.floating):
        return _each(lambda v: graph.apply("trunc", v), x)
    return x


def _with_own_rule(graph: Graph, equation: Any, inputs: Sequence[Values]) -> list[Values]:
    """A function with its own derivative rule: the rule's partial derivatives stand beside the results."""
    results = run(graph, equation.params["call_jaxpr"], inputs)
    if any(x.size != 1 for x in (*inputs, *results)):
        return results  # derived element by element, through what it computes
    if all(result in graph.partials or graph.value(result) is not None for result in scalars(results)):
        return results
    for result in scalars(results):
        graph.partials.setdefault(result, [])  # the rule itself may call the function
    variables = [v for v in equation.invars if not isinstance(v, Literal)]
    given = [x for v, x in zip(equation.invars, inputs, strict=True) if not isinstance(v, Literal)]
    debug = equation.params["call_jaxpr"].jaxpr.debug_info
    alone = Jaxpr((), variables, equation.outvars, [equation], debug_info=debug)
    function = jaxpr_as_fun(ClosedJaxpr(alone, ()))
    shapes = tuple(jax.numpy.zeros(v.aval.shape, v.aval.dtype) for v in variables)
    rule = jax.make_jaxpr(lambda x, t: jax.jvp(lambda *a: function(*a), x, t)[1])(shapes, shapes)
    for i, x in enumerate(given):
        unit = [constants(graph, np.full(x.shape, float(i == k))) for k, x in enumerate(given)]
        for result, slope in zip(scalars(results), scalars(run(graph, rule, [*given, *unit])), strict=True):
            graph.partials[result].append((scalars([x])[0], slope))
    return results


def loop_sizes(equation: Any) -> tuple[int, int]:
    """How many inputs of a scan are the same in every turn, and how many values it carries from one to the next.

    From the shapes: the names under which JAX keeps these numbers change with its versions.
    """
    body = equation.params["jaxpr"].jaxpr

    def by_row(outer: Sequence[Any], inner: Sequence[Any]) -> int:
        """How many variables the body sees one row of at a time."""
        return sum(v.aval.ndim > w.aval.ndim for v, w in zip(outer, inner, strict=True))

    carried = len(equation.outvars) - by_row(equation.outvars, body.outvars)
    return len(equation.invars) - by_row(equation.invars, body.invars) - carried, carried


def _scan(graph: Graph, equation: Any, inputs: Sequence[Values]) -> list[Values]:
    params = equation.params
    length = params["length"]
    if length > MOST_UNROLLED:
        raise Untranslated(f"an inner loop of {length} turns")
    n_const, n_carry = loop_sizes(equation)
    fixed, carry, rows = inputs[:n_const], list(inputs[n_const : n_const + n_carry]), inputs[n_const + n_carry :]
    stacked: list[list[Values]] = []
    turns = range(length)
    for i in reversed(turns) if params["reverse"] else turns:
        results = run(graph, params["jaxpr"], [*fixed, *carry, *(np.asarray(row[i], dtype=object) for row in rows)])
        carry = results[:n_carry]
        stacked.append(results[n_carry:])
    if params["reverse"]:
        stacked.reverse()
    ys = [np.stack([np.asarray(turn[k], dtype=object) for turn in stacked]) for k in range(len(stacked[0]))]
    return [*carry, *ys]


def run(graph: Graph, closed: ClosedJaxpr | Any, inputs: Sequence[Values]) -> list[Values]:
    """Results of a jaxpr on expressions. Raises `Untranslated`."""
    jaxpr = getattr(closed, "jaxpr", closed)
    known: dict[Any, Values] = dict(zip(jaxpr.invars, inputs, strict=True))
    for variable, value in zip(jaxpr.constvars, getattr(closed, "consts", ()), strict=True):
        known[variable] = constants(graph, value)
    last_use = {v: i for i, e in enumerate(jaxpr.eqns) for v in e.invars if not isinstance(v, Literal)}

    def read(atom: Any) -> Values:
        return constants(graph, atom.val) if isinstance(atom, Literal) else known[atom]

    kept = {v for v in jaxpr.outvars if not isinstance(v, Literal)}
    for i, equation in enumerate(jaxpr.eqns):
        results = _equation(graph, equation, [read(atom) for atom in equation.invars])
        known.update(zip(equation.outvars, results, strict=True))
        for v in {v for v in equation.invars if not isinstance(v, Literal)}:
            if last_use[v] == i and v not in kept:
                known.pop(v, None)
    return [read(atom) for atom in jaxpr.outvars]


def inputs(graph: Graph, group: str, count: int) -> list[Values]:
    """`count` scalar inputs of one group."""
    return [np.array(graph.input(group, i), dtype=object) for i in range(count)]


def scalars(values: Sequence[Values]) -> list[Node]:
    """Scalar results as nodes. Raises `Untranslated` where a result is no scalar."""
    if any(np.size(value) != 1 for value in values):
        raise Untranslated("a result that is no scalar")
    return [np.asarray(value, dtype=object).ravel()[0] for value in values]
