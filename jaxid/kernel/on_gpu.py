"""A rollout as one kernel of a GPU: a thread an experiment and, for tangents, a direction; states never leave its registers.

The same expressions as in the processor's machine code (`rollout_kernel`), written in Pallas. As XLA's scan, every sample
would be some hundred kernels, each of which moves all states to memory and back.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jax.experimental import pallas
from jax.experimental.pallas import triton
from jaxtyping import Array

from .emit import levels, reached
from .expressions import Graph, Node
from .tangents import forward
from .traced import Step, traced

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


class GpuProgram(NamedTuple):
    """A sampled system as expressions of the groups "p", "x", "u" and "h", and, for derivatives, one direction's tangents of
    the groups "dp", "dx" and "du": a thread follows one direction, so that no Jacobian of a step is needed.

    `state`: of the states, and with derivatives of their tangents behind them. `output`: of what is shown, or of its tangents.
    `fixed`: states that are set at every sample. `moves`: whether it is of derivatives.
    """

    graph: Graph
    states: int
    state: Sequence[Node]
    output: Sequence[Node]
    fixed: Sequence[int]
    moves: bool


def gpu_program(
    step: Step,
    output: Step,
    sizes: tuple[int, int, int],
    fixed: tuple[int, ...] = (),
    moving: tuple[int, ...] | None = None,
    inputs_move: bool = False,
) -> GpuProgram:
    """As `traced.program`. Raises `Untranslated`."""
    graph, (p, x, u), state, shown = traced(step, output, *sizes, fixed)
    if moving is None:
        return GpuProgram(graph, len(x), state, shown, fixed, moves=False)
    groups = {"dx": x, "dp": [p[i] for i in moving], "du": u if inputs_move else []}
    seeds = {node: graph.input(group, i) for group, nodes in groups.items() for i, node in enumerate(nodes)}
    state = [*state, *forward(graph, state, seeds)]
    return GpuProgram(graph, len(x), state, forward(graph, shown, seeds), fixed, moves=True)


_DEPTHS = {"p": 0, "dp": 0, "h": 1, "u": 2, "du": 2, "x": 3, "dx": 3}
"""How deep in the loops what is given stands."""


def _kernel(program: GpuProgram, sizes: tuple[int, int, int], *refs: Any) -> None:
    """One block's rollouts. `sizes`: samples, rows of inputs a sample and sub-steps; `refs`: the arrays of
    `call_on_gpu` and the result, the experiments along the last axis, and before these, where there are any, the directions."""
    graph, S, (samples, rows, substeps) = program.graph, program.states, sizes
    shares, p, x, u, dt, fixed, *directions, result = refs
    some = pallas.ds(pallas.program_id(0) * WIDTH, WIDTH)
    k = pallas.program_id(1)
    dp, dx, du = directions or (p, x, u)  # not read where nothing moves
    stepping, showing = reached(graph, program.state), reached(graph, program.output)
    depth = levels(graph, sorted({*stepping, *showing}), _DEPTHS)
    still = {"p": lambda i: p[i, some], "dp": lambda i: dp[i, k, some]}
    constant: dict[Node, Block] = {}
    _evaluate(graph, [node for node in sorted(depth) if depth[node] == 0], constant, lambda group, i: still[group](i))

    def given(state: Sequence[Block], t: Any, row: Any, h: Block) -> Callable[[str, int], Block]:
        read = {
            "x": lambda i: state[i],
            "dx": lambda i: state[S + i],
            "u": lambda i: u[t, row, i, some],
            "du": lambda i: du[t, row, i, k, some],
            "h": lambda _: h,
            **still,
        }
        return lambda group, i: read[group](i)

    def sample(t: Any, before: tuple) -> tuple:
        state = list(before)
        for d, i in enumerate(program.fixed):
            state[i] = fixed[t, d, some]
            if directions:
                state[S + i] = jnp.zeros(WIDTH)
        values = dict(constant)
        _evaluate(graph, showing, values, given(state, t, 0, jnp.zeros(WIDTH)))
        for i, node in enumerate(program.output):
            result[(t, i, k, some) if directions else (t, i, some)] = values[node]
        interval = dt[t, some]

        def substep(number: Any, state: tuple) -> tuple:
            row, values = (0 if rows == 1 else number), dict(constant)
            _evaluate(graph, stepping, values, given(state, t, row, interval * shares[number]))
            return tuple(values[node] for node in program.state)

        return lax.fori_loop(0, substeps, substep, tuple(state))

    start = [x[i, some] for i in range(S)]
    slopes = [dx[i, k, some] for i in range(S)] if directions else []
    lax.fori_loop(0, samples, sample, (*start, *slopes))


def _last(array: Array, lanes: int) -> Array:
    """[E, ...] -> [..., lanes]; what is over is filled up with the last experiment. Of nothing, a number that nobody reads."""
    if array.size == 0:
        return jnp.zeros(1)
    filled = jnp.concatenate([array, jnp.broadcast_to(array[-1:], (lanes - len(array), *array.shape[1:]))])
    return jnp.moveaxis(filled, 0, -1)


def call_on_gpu(program: GpuProgram, shape: Sequence[int], arrays: Sequence[Array], interpret: bool = False) -> Array:
    """Outputs [E, T, Y], or, of a program with derivatives, their tangents [E, T, Y, K] in K directions.

    `shape`: the result's without E. `arrays`: `shares` [n], `p` [E, P], `x` [E, S], `u` [E, T, R, U], `dt` [E, T], `fixed`
    [E, T, D] and, with derivatives, `dp` [E, K, n], `dx` [E, K, S] and `du` [E, T, R, K, U]. `interpret`: by JAX operations on
    a processor, for tests.
    """
    shares, *own = arrays
    E, (T, R) = own[0].shape[0], own[2].shape[1:3]
    blocks = -(-E // WIDTH)
    directions = shape[2] if len(shape) == 3 else 1
    if program.moves:  # the direction beside the experiments, so that a block reads what lies side by side
        own[5:] = [jnp.moveaxis(own[5], 1, 2), jnp.moveaxis(own[6], 1, 2), jnp.moveaxis(own[7], 3, 4)]
    made = pallas.pallas_call(
        partial(_kernel, program, (T, R, len(shares))),
        out_shape=jax.ShapeDtypeStruct((*shape, blocks * WIDTH), jnp.float64),
        grid=(blocks, directions),
        compiler_params=triton.CompilerParams(num_warps=1, num_stages=1),
        interpret=interpret,
    )(shares, *(_last(array, blocks * WIDTH) for array in own))
    return jnp.moveaxis(made[..., :E], -1, 0)
