"""A rollout as one kernel of a GPU: a thread an experiment and, for tangents, a direction; states never leave its registers.

The same expressions as in the processor's machine code (`rollout_kernel`), written in Pallas. As XLA's scan, every sample
would be some hundred kernels, each of which moves all states to memory and back.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax
from jax.experimental import pallas
from jax.experimental.pallas import triton
from jaxtyping import Array

from .emit import levels, reached
from .expressions import Graph, Node
from .rollout_kernel import Derivatives, Program

WIDTH = 32
"""Experiments a block: one warp, so that few experiments still keep many of the GPU's processors at work."""
Block = Any
"""[WIDTH] numbers."""


def _not_zero(x: Block) -> Block:
    return x if x.dtype == bool else x != 0.0


def _sign(x: Block) -> Block:
    return jnp.where(x < 0.0, -1.0, jnp.where(x > 0.0, 1.0, x))


def _round(x: Block) -> Block:
    """Half to even."""
    up = lax.floor(x + 0.5)
    return jnp.where((up - x == 0.5) & (up != 2.0 * lax.floor(0.5 * up)), up - 1.0, up)


_OPERATIONS: Mapping[str, Callable[..., Block]] = {
    "add": lax.add, "sub": lax.sub, "mul": lax.mul, "neg": lax.neg, "reciprocal": lambda x: 1.0 / x,
    "max": lax.max, "min": lax.min, "lt": lax.lt, "le": lax.le, "gt": lax.gt, "ge": lax.ge, "eq": lax.eq, "ne": lax.ne,
    "select": lambda which, if_false, if_true: jnp.where(_not_zero(which), if_true, if_false),
    "and": lambda a, b: _not_zero(a) & _not_zero(b), "or": lambda a, b: _not_zero(a) | _not_zero(b),
    "not": lambda a: ~_not_zero(a), "is_finite": lambda x: x - x == 0.0, "sign": _sign,
    "trunc": lambda x: jnp.where(x < 0.0, -lax.floor(-x), lax.floor(x)), "round": _round,
}  # fmt: skip
"""Those that are not a function of the same name in `jax.lax`."""


def _evaluate(
    graph: Graph, nodes: Sequence[Node], values: dict[Node, Block], given: Callable[[str, int], Block]
) -> None:
    """Put `nodes`, arguments first, beside the `values` that are known."""
    for node in nodes:
        if node in values:
            continue
        operation, arguments = graph.nodes[node]
        if operation == "const":
            values[node] = jnp.full(WIDTH, arguments[0])
        elif operation == "input":
            values[node] = given(*arguments)
        else:
            function = _OPERATIONS.get(operation) or getattr(lax, operation)
            values[node] = function(*(values[a] for a in arguments))


def _tangents_of(
    graph: Graph,
    by: Derivatives,
    values: Mapping[Node, Block],
    x: Sequence[Block],
    p: Sequence[Block],
    u: Sequence[Block],
) -> list[Block]:
    """Tangents of results from those of the state, of the parameters that move and of the inputs."""
    results = []
    for rows in zip(by.by_x, by.by_p, by.by_u, strict=True):
        total = jnp.zeros(WIDTH)
        for slope, tangent in zip((*rows[0], *rows[1], *rows[2]), (*x, *p, *u), strict=True):
            if graph.value(slope) != 0.0:
                total = total + (tangent if graph.value(slope) == 1.0 else values[slope] * tangent)
        results.append(total)
    return results


def _kernel(program: Program, sizes: tuple[int, int, int], *refs: Any) -> None:
    """One block's rollouts. `sizes`: samples, rows of inputs a sample and sub-steps; `refs`: `ARGUMENTS`, with tangents
    `TANGENTS`, and the result, the experiments along the last axis, and before these, where there are any, the directions."""
    graph, (samples, rows, substeps) = program.graph, sizes
    shares, p, x, u, dt, fixed, *moving, result = refs
    some = pallas.ds(pallas.program_id(0) * WIDTH, WIDTH)
    k = pallas.program_id(1)
    by_state, by_output = program.state_by or Derivatives((), (), ()), program.output_by or Derivatives((), (), ())

    def made_of(results: Sequence[Node], by: Derivatives) -> list[Node]:
        return reached(graph, [*results, *(slope for each in by for row in each for slope in row)])

    stepping = made_of(program.state, by_state)
    showing = made_of(() if moving else program.output, by_output)
    depth = levels(graph, sorted({*stepping, *showing}), {"p": 0, "h": 1, "u": 2, "x": 3})
    constant: dict[Node, Block] = {}
    _evaluate(graph, [node for node in sorted(depth) if depth[node] == 0], constant, lambda _, i: p[i, some])
    direction = [moving[0][j, k, some] for j in range(len(by_state.by_p[0]))] if moving else []

    def inputs_move(t: Any, row: Any) -> list[Block]:
        count = len(by_state.by_u[0]) if moving and by_state.by_u else 0
        return [moving[2][t, row, j, k, some] for j in range(count)]

    def given(state: Sequence[Block], t: Any, row: Any, h: Block) -> Callable[[str, int], Block]:
        return lambda group, i: {"x": lambda: state[i], "u": lambda: u[t, row, i, some], "h": lambda: h}[group]()

    def sample(t: Any, carry: tuple) -> tuple:
        state, tangent = (list(each) for each in carry)
        for d, i in enumerate(program.fixed):
            state[i] = fixed[t, d, some]
            if moving:
                tangent[i] = jnp.zeros(WIDTH)
        values = dict(constant)
        _evaluate(graph, showing, values, given(state, t, 0, jnp.zeros(WIDTH)))
        if moving:
            for i, shown in enumerate(_tangents_of(graph, by_output, values, tangent, direction, inputs_move(t, 0))):
                result[t, i, k, some] = shown
        else:
            for i, node in enumerate(program.output):
                result[t, i, some] = values[node]
        interval = dt[t, some]

        def substep(number: Any, carry: tuple) -> tuple:
            state, tangent = carry
            row, values = (0 if rows == 1 else number), dict(constant)
            _evaluate(graph, stepping, values, given(state, t, row, interval * shares[number]))
            after = _tangents_of(graph, by_state, values, tangent, direction, inputs_move(t, row)) if moving else ()
            return tuple(values[node] for node in program.state), tuple(after)

        return lax.fori_loop(0, substeps, substep, (tuple(state), tuple(tangent)))

    start = tuple(x[i, some] for i in range(len(program.state)))
    slopes = tuple(moving[1][i, k, some] for i in range(len(program.state))) if moving else ()
    lax.fori_loop(0, samples, sample, (start, slopes))


def _last(array: Array, lanes: int) -> Array:
    """[E, ...] -> [..., lanes]; what is over is filled up with the last experiment. Of nothing, a number that nobody reads."""
    if array.size == 0:
        return jnp.zeros(1)
    filled = jnp.concatenate([array, jnp.broadcast_to(array[-1:], (lanes - len(array), *array.shape[1:]))])
    return jnp.moveaxis(filled, 0, -1)


def call_on_gpu(program: Program, shape: Sequence[int], arrays: Sequence[Array], interpret: bool = False) -> Array:
    """Outputs [E, T, Y], or, of a program with derivatives, their tangents [E, T, Y, K] in K directions.

    `shape`: the result's without E. `arrays`: `shares` [n], `p` [E, P], `x` [E, S], `u` [E, T, R, U], `dt` [E, T], `fixed`
    [E, T, D] and, with derivatives, `dp` [E, K, n], `dx` [E, K, S] and `du` [E, T, R, K, U]. `interpret`: as NumPy would, for
    tests on a processor.
    """
    shares, *own = arrays
    E, (T, R) = own[0].shape[0], own[2].shape[1:3]
    blocks = -(-E // WIDTH)
    directions = shape[2] if len(shape) == 3 else 1
    if len(own) > 5:  # the direction beside the experiments, so that a block reads what lies side by side
        own[5:] = [jnp.moveaxis(own[5], 1, 2), jnp.moveaxis(own[6], 1, 2), jnp.moveaxis(own[7], 3, 4)]
    made = pallas.pallas_call(
        partial(_kernel, program, (T, R, len(shares))),
        out_shape=jax.ShapeDtypeStruct((*shape, blocks * WIDTH), jnp.float64),
        grid=(blocks, directions),
        compiler_params=triton.CompilerParams(num_warps=1, num_stages=1),
        interpret=interpret,
    )(shares, *(_last(array, blocks * WIDTH) for array in own))
    return jnp.moveaxis(made[..., :E], -1, 0)
