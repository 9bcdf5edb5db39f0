"""A robot's functions as expressions: one integration step and what the sensors show, traced once."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp

from .expressions import Graph, Node
from .remembered import Made, remembered
from .rollout_kernel import Derivatives, Program
from .symbolic import inputs, run, scalars
from .tangents import backward, forward

Step = Callable[..., Sequence[Any]]


def _derivatives(graph: Graph, results: Sequence[Node], groups: Sequence[Sequence[Node]]) -> Derivatives:
    if len(results) <= sum(map(len, groups)):
        seeds = [seed for group in groups for seed in group]
        rows = [iter(backward(graph, result, seeds)) for result in results]
        return Derivatives(*([[next(row) for _ in group] for row in rows] for group in groups))
    one = graph.constant(1.0)
    columns = [[forward(graph, results, {seed: one}) for seed in seeds] for seeds in groups]
    by = [[[column[i] for column in group] for i in range(len(results))] for group in columns]
    return Derivatives(*by)


MOST_MODELS = 256
"""Models whose expressions and machine code are known; explaining one robot after another makes some ten for each."""


@lru_cache(MOST_MODELS)
def traced(
    step: Step, output: Step, parameters: int, states: int, inputs_: int, fixed: tuple[int, ...]
) -> tuple[Graph, list[list[Node]], list[Node], list[Node]]:
    """`step(p, x, u, h) -> x` and `output(p, x, u) -> y`, functions of tuples of scalars, as expressions.

    Raises `Untranslated`.
    """
    zero = jnp.zeros(())
    p, x, u = ((zero,) * count for count in (parameters, states, inputs_))
    graph = Graph()
    given = [inputs(graph, group, count) for group, count in (("p", parameters), ("x", states), ("u", inputs_))]
    h = inputs(graph, "h", 1)
    state = scalars(run(graph, jax.make_jaxpr(step)(p, x, u, zero), [*given[0], *given[1], *given[2], *h]))
    shown = scalars(run(graph, jax.make_jaxpr(output)(p, x, u), [*given[0], *given[1], *given[2]]))
    return graph, [scalars(group) for group in given], state, shown


def program(
    step: Step,
    output: Step,
    sizes: tuple[int, int, int],
    fixed: tuple[int, ...] = (),
    moving: tuple[int, ...] | None = None,
    inputs_move: bool = False,
) -> Program:
    """The rollout's program; with the tangents for the parameters `moving` (and of the inputs, if they move) or, for None,
    without. Raises `Untranslated`."""
    graph, (p, x, u), state, shown = traced(step, output, *sizes, fixed)
    if moving is None:
        return Program(graph, sizes[0], sizes[2], state, shown, fixed)
    groups = (x, [p[i] for i in moving], u if inputs_move else [])
    by = (_derivatives(graph, results, groups) for results in (state, shown))
    return Program(graph, sizes[0], sizes[2], state, shown, fixed, *by)


def shown_states(
    step: Step, output: Step, sizes: tuple[int, int, int], fixed: tuple[int, ...] = (), identity: str | None = None
) -> list[int] | None:
    """Which state each output is, where all of them are states as they stand, else None. Raises `Untranslated`."""

    def make() -> Made:
        _, (_, x, _), _, shown = traced(step, output, *sizes, fixed)
        known = set(shown) <= set(x)
        return Made((), (int(known), *(x.index(node) for node in shown if known)))

    known, *places = remembered(identity, "shown states", make).numbers
    return places if known else None
