"""jaxid/kernel/{expressions,symbolic,tangents}.py: random functions of JAX and their derivatives, evaluated by hand."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.kernel.expressions import Graph
from jaxid.kernel.symbolic import Untranslated, inputs, run, scalars
from jaxid.kernel.tangents import backward, forward

EVALUATED = {
    "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "neg": lambda a: -a,
    "reciprocal": lambda a: 1 / a, "max": max, "min": min, "abs": abs, "select": lambda w, f, t: t if w else f,
    "lt": lambda a, b: a < b, "gt": lambda a, b: a > b, "ge": lambda a, b: a >= b, "eq": lambda a, b: a == b,
    "sign": lambda a: float(np.sign(a)), "exp": math.exp, "log": math.log, "sqrt": math.sqrt, "sin": math.sin,
    "cos": math.cos, "tanh": math.tanh, "atan2": math.atan2, "log1p": math.log1p, "expm1": math.expm1, "pow": math.pow,
    "floor": math.floor, "round": round,
}  # fmt: skip


def evaluated(graph, node, given):
    operation, arguments = graph.nodes[node]
    if operation == "const":
        return arguments[0]
    if operation == "input":
        return given[arguments[1]]
    return EVALUATED[operation](*(evaluated(graph, a, given) for a in arguments))


FUNCTIONS = {
    "rational": lambda a, b: (a * b - a / (1 + b**2)) ** 3,
    "transcendental": lambda a, b: (
        jnp.sin(a) * jnp.exp(-b) + jnp.tanh(a * b) - jnp.log(1 + b * b) * jnp.sqrt(2 + jnp.cos(b))
    ),
    "angles and powers": lambda a, b: (
        jnp.arctan2(a, b) + jnp.arctan2(b, a) * a + jnp.log1p(b) * jnp.expm1(a) + jnp.power(b, 1.7)
    ),
    "steering and its inverse": lambda a, b: (
        jnp.tan(a) * b + jnp.arctan(a * b) + jnp.arcsin(0.7 * a) * jnp.arccos(-b) + jnp.sinh(a) / jnp.cosh(b)
    ),
    "limits": lambda a, b: jnp.clip(a, -b, b) + jnp.maximum(a, b) * jnp.minimum(a, 0.3) + jnp.abs(a - b),
    "branches": lambda a, b: jnp.where(a > b, a * a, b * a) + jnp.sign(a) * b,
    "small arrays": lambda a, b: (
        (jnp.stack([a, b]) @ jnp.array([[1.0, 2.0], [0.0, -1.0]])).sum() + jnp.array([a, b])[1]
    ),
    "loop": lambda a, b: jax.lax.scan(lambda c, w: (c * b + w, None), a, jnp.array([1.0, -2.0, 0.5]))[0],
}


@pytest.mark.usefixtures("double_precision")
@pytest.mark.parametrize("at", [(0.7, 0.4), (-1.2, 0.4), (0.4, 0.4), (0.0, 0.4)], ids=str)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_values_and_derivatives_are_those_of_jax(name, at):
    function = FUNCTIONS[name]
    graph = Graph()
    given = inputs(graph, "x", 2)
    (result,) = scalars(run(graph, jax.make_jaxpr(function)(0.5, 0.5), given))
    assert evaluated(graph, result, at) == pytest.approx(float(function(*map(jnp.asarray, at))), rel=1e-12, abs=1e-14)
    together = backward(graph, result, scalars(given))
    for i, x in enumerate(scalars(given)):
        (slope,) = forward(graph, [result], {x: graph.constant(1.0)})
        expected = jax.jacfwd(function, argnums=i)(*map(jnp.asarray, at))
        assert evaluated(graph, slope, at) == pytest.approx(float(expected), rel=1e-10, abs=1e-12)
        assert evaluated(graph, together[i], at) == pytest.approx(float(expected), rel=1e-10, abs=1e-12)


def eagerly(graph, node, given):
    """As `evaluated`, with both branches of every choice, as machine code does."""
    operation, arguments = graph.nodes[node]
    if operation in ("const", "input"):
        return np.float64(evaluated(graph, node, given))
    found = [eagerly(graph, a, given) for a in arguments]
    named = {"sqrt": np.sqrt, "log": np.log, "reciprocal": np.reciprocal, "pow": np.power}
    return np.float64(named.get(operation, EVALUATED[operation])(*found))


@pytest.mark.usefixtures("double_precision")
@pytest.mark.parametrize("at", [(0.7, 0.4), (0.0, 0.4), (-0.7, 0.4)], ids=str)
@pytest.mark.parametrize(
    "law",
    [lambda a, b: b * jnp.log(a), lambda a, b: b * b / a, lambda a, b: a**-0.5 + b, lambda a, b: jnp.log(a) * b * b],
)
def test_a_branch_that_is_not_taken_has_no_part_in_derivatives(law, at):
    """Where it has no finite value, too, and choices feed one another."""

    def chosen(a, b):
        inner = jnp.where(a > 0.0, law(a, b), b)
        return jnp.where(a > 0.1, law(inner * inner + a, inner), inner * a)

    graph = Graph()
    given = inputs(graph, "x", 2)
    (result,) = scalars(run(graph, jax.make_jaxpr(chosen)(0.5, 0.5), given))
    with np.errstate(all="ignore"):
        found = [eagerly(graph, slope, at) for slope in backward(graph, result, scalars(given))]
    expected = [jax.jacfwd(chosen, argnums=i)(*map(jnp.asarray, at)) for i in range(2)]
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)


@pytest.mark.usefixtures("double_precision")
@pytest.mark.parametrize(
    "law",
    [
        lambda v, w: v * jnp.abs(v) ** 0.5,
        lambda v, w: v * jnp.sqrt(jnp.abs(w)),
        lambda v, w: jnp.sqrt(v * v + w * w) * v,
    ],
)
def test_laws_with_roots_have_their_slopes_at_rest(law):
    graph = Graph()
    given = inputs(graph, "x", 2)
    (result,) = scalars(run(graph, jax.make_jaxpr(law)(0.5, 0.5), given))
    for i, x in enumerate(scalars(given)):
        (slope,) = forward(graph, [result], {x: graph.constant(1.0)})
        assert evaluated(graph, slope, (0.0, 0.0)) == pytest.approx(0.0, abs=1e-12)
        expected = jax.jacfwd(law, argnums=i)(jnp.asarray(0.02), jnp.asarray(-0.03))
        assert evaluated(graph, slope, (0.02, -0.03)) == pytest.approx(float(expected), rel=1e-10)


def test_equal_expressions_stand_once_and_nothing_is_kept_of_zero():
    graph = Graph()
    a, b = scalars(inputs(graph, "x", 2))
    assert graph.add(a, b) == graph.add(b, a)
    assert graph.mul(a, graph.constant(0.0)) == graph.constant(0.0)
    assert graph.sub(graph.add(a, graph.constant(0.0)), a) == graph.constant(0.0)
    (slope,) = forward(graph, [graph.mul(a, a)], {b: graph.constant(1.0)})
    assert slope == graph.constant(0.0)


@pytest.mark.usefixtures("double_precision")
def test_what_has_no_translation_is_named():
    graph = Graph()
    with pytest.raises(Untranslated, match="sort"):
        run(graph, jax.make_jaxpr(lambda a, b: jnp.sort(jnp.stack([a, b]))[0])(0.5, 0.5), inputs(graph, "x", 2))
