"""Rollouts in machine code as ordinary functions of JAX: under `jit`, `vmap` and forward-mode differentiation.

Lanes are experiments: whatever `vmap` adds joins them, or, where only tangents are many, the directions.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from .machine import lanes, loaded, register, write_handler
from .remembered import Made, remembered
from .rollout_kernel import ARGUMENTS, TANGENTS, write_rollout
from .traced import MOST_MODELS, Step, program

MOST_DIRECTIONS = 128
"""Directions at a time: their tangents live on the stack."""


class System(NamedTuple):
    """A sampled system: `step(p, x, u, h) -> x` and `output(p, x, u) -> y`, functions of tuples of scalars.

    `sizes`: numbers of parameters, states and inputs; `outputs`: of outputs; `fixed`: states set at every sample. Two
    systems of equal functions share their machine code. `identity`: a name for the functions that holds in other processes,
    too (`identity.identity_of`); None where they have none.
    """

    step: Step
    output: Step
    sizes: tuple[int, int, int]
    outputs: int
    fixed: tuple[int, ...] = ()
    identity: str | None = None

    def showing(self, output: Step, outputs: int, what: str) -> "System":
        """The system with other outputs, which are `what` of it."""
        identity = self.identity and f"{self.identity} {what}"
        return self._replace(output=output, outputs=outputs, identity=identity)


class Run(NamedTuple):
    """What E rollouts start from and see: `p` [E, P], `x` [E, S], `u` [E, T, R, U] with one row of inputs a sample or one a
    sub-step, `dt` [E, T] s, `fixed` [E, T, D]; `shares` [n]: how the sub-steps divide an interval."""

    shares: Array
    p: Array
    x: Array
    u: Array
    dt: Array
    fixed: Array


class Directions(NamedTuple):
    """Tangents in K directions: `dp` [E, K, n] of the parameters that move, `dx` [E, K, S], `du` [E, T, R, K, U] (no inputs
    where these do not move)."""

    dp: Array
    dx: Array
    du: Array


@lru_cache(MOST_MODELS)
def machine_code(system: System, moving: tuple[int, ...] | None, inputs_move: bool = False) -> str:
    """Name of the loaded machine code: of outputs, or, with the parameters that are `moving`, of their tangents. Raises
    `Untranslated`."""

    def make() -> Made:
        module = write_rollout(
            program(system.step, system.output, system.sizes, system.fixed, moving, inputs_move), lanes()
        )
        names = (*ARGUMENTS, *TANGENTS) if moving is not None else ARGUMENTS
        u, shares = names.index("u"), names.index("shares")
        # Without directions their number is not used.
        directions = (names.index("dp"), 1) if moving is not None else (shares, 0)
        write_handler(module, [(u, 0), (u, 1), (u, 2), directions, (shares, 0)], len(names))
        return Made((loaded(module),))

    return remembered(system.identity, f"rollout {moving} {inputs_move}", make).code[0]


def grouped(array: Array, width: int) -> Array:
    """[E, ...] -> [G, ..., width]: lanes side by side; the last group is filled up with the last lane."""
    E = array.shape[0]
    groups = -(-E // width)
    if groups * width > E:
        fill = jnp.broadcast_to(array[-1:], (groups * width - E, *array.shape[1:]))
        array = jnp.concatenate([array, fill])
    return jnp.moveaxis(array.reshape(groups, width, *array.shape[1:]), 1, -1)


def ungrouped(array: Array, E: int) -> Array:
    """[G, ..., width] -> [E, ...]."""
    return jnp.moveaxis(array, -1, 1).reshape(array.shape[0] * array.shape[-1], *array.shape[1:-1])[:E]


Called = Callable[[Sequence[int], Sequence[Array]], Array]
"""`(shape, arrays) -> result`: the result's shape without E, and the arrays of a `Run` and its `Directions`."""


def _compiled(system: System, moving: tuple[int, ...] | None, inputs_move: bool = False) -> Called:
    """The rollout's outputs, or tangents, on the device in use. Raises `Untranslated`."""
    if jax.default_backend() == "cpu":
        return partial(_in_lanes, register(machine_code(system, moving, inputs_move)))
    from .on_gpu import call_on_gpu, gpu_program  # Pallas takes its time to import

    made = gpu_program(system.step, system.output, system.sizes, system.fixed, moving, inputs_move)
    return partial(call_on_gpu, made)


def _in_lanes(name: str, shape: Sequence[int], arrays: Sequence[Array]) -> Array:
    """By the processor's machine code of this name."""
    shares, *own = arrays
    width = lanes()
    E = own[0].shape[0]
    shares = jnp.broadcast_to(shares[:, None], (shares.shape[0], width))
    result = jax.ShapeDtypeStruct((-(-E // width), *shape, width), jnp.float64)
    return ungrouped(jax.ffi.ffi_call(name, result)(shares, *(grouped(a, width) for a in own)), E)


def _joined(size: int, batched: Sequence[bool], arrays: Sequence[Array]) -> list[Array]:
    """Arrays whose first axis takes up the batch."""
    wide = [
        a if is_batched else jnp.broadcast_to(a, (size, *a.shape))
        for a, is_batched in zip(arrays, batched, strict=True)
    ]
    return [a.reshape(a.shape[0] * a.shape[1], *a.shape[2:]) for a in wide]


def _apart(y: Array, size: int) -> Array:
    return y.reshape(size, y.shape[0] // size, *y.shape[1:])


@lru_cache(MOST_MODELS)
def _outputs(system: System):
    """`(shares, p, x, u, dt, fixed) -> y [E, T, Y]`."""
    called = _compiled(system, None)

    @custom_vmap
    def outputs(*arrays: Array) -> Array:
        return called((Run(*arrays).dt.shape[1], system.outputs), arrays)

    @outputs.def_vmap
    def _(size, batched, *arrays):
        first = [a[0] if b else a for a, b in zip(arrays[:1], batched[:1], strict=True)]
        return _apart(outputs(*first, *_joined(size, batched[1:], arrays[1:])), size), True

    return outputs


@lru_cache(MOST_MODELS)
def _tangents(system: System, moving: tuple[int, ...], inputs_move: bool):
    """`(shares, p, x, u, dt, fixed, dp, dx, du) -> dy [E, T, Y, K]`."""
    called = _compiled(system, moving, inputs_move)

    @custom_vmap
    def tangents(*arrays: Array) -> Array:
        run, (dp, dx, du) = Run(*arrays[:6]), arrays[6:]
        parts = []
        for first in range(0, dp.shape[1], MOST_DIRECTIONS):
            some = slice(first, first + MOST_DIRECTIONS)
            shape = (run.dt.shape[1], system.outputs, dp[:, some].shape[1])
            parts.append(called(shape, (*run, dp[:, some], dx[:, some], du[:, :, :, some])))
        return parts[0] if len(parts) == 1 else jnp.concatenate(parts, axis=-1)

    @tangents.def_vmap
    def _(size, batched, *arrays):
        if any(batched[:6]):
            first = arrays[0][0] if batched[0] else arrays[0]
            return _apart(tangents(first, *_joined(size, batched[1:], arrays[1:])), size), True
        # The same rollouts in more directions.
        E = arrays[1].shape[0]
        wide = [a if b else jnp.broadcast_to(a, (size, *a.shape)) for a, b in zip(arrays[6:], batched[6:], strict=True)]
        dp, dx = (jnp.moveaxis(a, 0, 1).reshape(E, size * a.shape[2], a.shape[-1]) for a in wide[:2])
        du = jnp.moveaxis(wide[2], 0, 3)
        du = du.reshape(*du.shape[:3], du.shape[3] * du.shape[4], du.shape[-1])
        dy = tangents(*arrays[:6], dp, dx, du)
        return jnp.moveaxis(dy.reshape(*dy.shape[:3], size, -1), 3, 0), True

    return tangents


def _tangent(t: Array | SymbolicZero) -> Array:
    return jnp.zeros(t.shape) if isinstance(t, SymbolicZero) else t


@lru_cache(MOST_MODELS)
def _differentiable(system: System):
    """`(shares, u, dt, fixed, *p, *x) -> y`, parameters [E] and states [E] one by one: what is constant costs no tangent."""
    P = system.sizes[0]

    @jax.custom_jvp
    def rollout(shares: Array, u: Array, dt: Array, fixed: Array, *scalars: Array) -> Array:
        run = Run(shares, jnp.stack(scalars[:P], axis=1), jnp.stack(scalars[P:], axis=1), u, dt, fixed)
        return _outputs(system)(*run)

    def rule(primals, tangents):
        shares, u, dt, fixed, *scalars = primals
        run = Run(shares, jnp.stack(scalars[:P], axis=1), jnp.stack(scalars[P:], axis=1), u, dt, fixed)
        E, T, R = u.shape[:3]
        S = run.x.shape[1]
        du, (dp, dx) = tangents[1], (tangents[4 : 4 + P], tangents[4 + P :])
        moving = tuple(i for i, t in enumerate(dp) if not isinstance(t, SymbolicZero))
        started = tuple(i for i, t in enumerate(dx) if not isinstance(t, SymbolicZero))
        n = len(moving)
        if not isinstance(du, SymbolicZero):
            own = jnp.stack([_tangent(dp[i]) for i in moving], axis=-1) if moving else jnp.zeros((E, 0))
            begin = jnp.stack([_tangent(t) for t in dx], axis=-1)
            directions = own[:, None], begin[:, None], du[:, :, :, None]
            return rollout(*primals), _tangents(system, moving, True)(*run, *directions)[..., 0]
        # The derivatives themselves: one call serves all directions, and the rule is linear in them.
        K = n + len(started)
        dp_unit = jnp.broadcast_to(jnp.eye(K, n), (E, K, n))
        dx_unit = jnp.broadcast_to(
            jnp.zeros((K, S)).at[n + jnp.arange(K - n), jnp.array(started, int)].set(1.0), (E, K, S)
        )
        jacobian = _tangents(system, moving, False)(*run, dp_unit, dx_unit, jnp.zeros((E, T, R, 0, 0)))
        direction = jnp.stack([*(dp[i] for i in moving), *(dx[i] for i in started)], axis=-1)
        return rollout(*primals), jnp.einsum("etyk,ek->ety", jacobian, direction)

    rollout.defjvp(rule, symbolic_zeros=True)
    return rollout


def rollout(
    system: System,
    p: Sequence[Float[Array, ""] | float],
    x: Sequence[Float[Array, ""] | float],
    u: Float[Array, "T R U"],
    dt: Float[Array, " T"],
    shares: Float[Array, " n"],
    fixed: Float[Array, "T D"],
) -> Float[Array, "T Y"]:
    """Outputs of one rollout at every sample, from parameters `p` and initial states `x`.

    `u` has one row a sample (held) or one a sub-step, `shares` says how the sub-steps divide an interval, and `fixed` holds
    the states that are set at every sample. Raises `Untranslated` where a function of `system` has no translation.
    """
    _outputs(system)
    scalars = [jnp.asarray(value, float)[None] for value in (*p, *x)]
    return _differentiable(system)(shares, u[None], dt[None], fixed[None], *scalars)[0]
