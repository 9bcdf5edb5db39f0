"""jaxid/kernel/{map,map_kernel}.py and `Graph.replaced`: expressions at many points, against NumPy and JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.kernel.expressions import Graph
from jaxid.kernel.map import compiled_maps
from jaxid.kernel.map_kernel import Mapped
from jaxid.kernel.symbolic import inputs, run, scalars
from jaxid.kernel.tangents import forward


def one_map(mapped):
    return compiled_maps(None, "", lambda: [mapped])[0]


@pytest.mark.parametrize("points", [1, 7, 8, 21])
def test_every_point_has_its_own_value_whatever_their_number(points):
    graph = Graph()
    (a, b), (p,) = scalars(inputs(graph, "row", 2)), scalars(inputs(graph, "p", 1))
    sine = graph.apply("sin", graph.mul(p, a))
    mapped = one_map(Mapped(graph, 2, [graph.add(sine, b), graph.constant(3.0), b]))
    rows = np.random.default_rng(0).normal(size=(points, 1, 2))
    found = mapped(np.array([1.7]), rows, np.zeros((points, 0)))[:, 0]
    expected = np.stack([np.sin(1.7 * rows[:, 0, 0]) + rows[:, 0, 1], np.full(points, 3.0), rows[:, 0, 1]], axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-15)


def test_what_is_carried_runs_along_the_rows_of_each_sequence():
    graph = Graph()
    (x,), (c,) = scalars(inputs(graph, "row", 1)), scalars(inputs(graph, "carried", 1))
    after = graph.add(graph.mul(graph.constant(0.5), c), x)
    mapped = one_map(Mapped(graph, 1, [c], [after]))
    rows, start = np.random.default_rng(1).normal(size=(11, 6, 1)), np.arange(11.0)[:, None]
    expected, level = np.zeros((11, 6)), start[:, 0]
    for t in range(6):
        expected[:, t] = level
        level = 0.5 * level + rows[:, t, 0]
    np.testing.assert_allclose(mapped(np.zeros(0), rows, start)[..., 0], expected, rtol=1e-14)


def test_no_points_are_no_results():
    graph = Graph()
    (x,) = scalars(inputs(graph, "row", 1))
    assert one_map(Mapped(graph, 1, [x]))(np.zeros(0), np.zeros((0, 1, 1)), np.zeros((0, 0))).shape == (0, 1, 1)


@jax.custom_jvp
def _limited(x):
    return jnp.clip(x, -1.0, 1.0)


@_limited.defjvp
def _(primals, tangents):
    return _limited(*primals), 0.25 * primals[0] * tangents[0]  # not what clip's own slope is


@pytest.mark.usefixtures("double_precision")
@pytest.mark.parametrize("at", [(0.3, -0.8), (2.0, 0.5)], ids=str)
def test_replaced_expressions_are_the_function_of_the_function_with_its_own_derivative_rule(at):
    def outer(x, y):
        return _limited(x) * jnp.where(x > y, y / x, jnp.exp(y)) - jnp.maximum(x, 0.1)

    def inner(a, b):
        return jnp.sin(a) + a * b

    graph = Graph()
    x, y = inputs(graph, "x", 2)
    (result,) = scalars(run(graph, jax.make_jaxpr(outer)(0.5, 0.5), [x, y]))
    (inside,) = scalars(run(graph, jax.make_jaxpr(inner)(0.5, 0.5), [x, y]))
    (both,) = graph.replaced([result], {scalars([x])[0]: inside})
    slopes = [forward(graph, [both], {seed: graph.constant(1.0)})[0] for seed in scalars([x, y])]
    row = dict(zip(scalars([x, y]), scalars(inputs(graph, "row", 2)), strict=True))
    mapped = one_map(Mapped(graph, 2, graph.replaced([both, *slopes], row)))
    a, b = map(jnp.asarray, at)

    def composed(a, b):
        return outer(inner(a, b), b)

    expected = [composed(a, b), *jax.jacfwd(composed, argnums=(0, 1))(a, b)]
    found = mapped(np.zeros(0), np.array(at)[None, None], np.zeros((1, 0)))[0, 0]
    np.testing.assert_allclose(found, np.array(expected), rtol=1e-12)
