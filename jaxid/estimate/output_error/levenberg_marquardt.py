"""Levenberg-Marquardt on the reduced output-error problem, by optimistix.

Coordinates are in units of the parameters' typical values and residuals in units of the noise, so that the damping
(identity) is a weak pull towards the last iterate for directions that the data hardly determines and nothing for those
it does. Sticking friction puts small kinks into the cost, and the caster's flips large ones, on which the usual schedule
of one damping after another takes many linearisations; so every step tries several dampings at once, by simulation, and
linearises at the best.

It stops where the linearisation promises no drop of the cost, or where steps no longer change it noticeably.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from ..._compile import compiled, forget_programs
from .problem import Problem, Structure, Triangle, Unknowns, cost, reduced_residual

_DAMPINGS = (1e-3, 0.1, 1.0, 10.0, 100.0, 1000.0)
"""Tried at every step, in units of the typical values. A simulation alone is cheap beside a linearisation, and dampings
run as its lanes."""
_STRONGER = 1e4
"""Factor by which all of them grow when none lowers the cost."""
_PROMISE = 5e-7
"""Promised drop of the cost below which the optimum is reached: a thousandth of a standard error."""
_NOTICEABLE = 0.01
"""Drop of the cost (half chi-squared) that counts as progress."""
_STALLED_STEPS = 2


class _Cost(eqx.Module):
    """Half the sum of squares by simulation alone."""

    structure: Structure = eqx.field(static=True)
    problem: Problem

    def __call__(self, unknowns: Unknowns) -> Float[Array, ""]:
        return cost(self.structure, self.problem, unknowns)


class _Linearised(eqx.Module):
    """Where the next steps start, and the singular values and vectors of the Jacobian there.

    `left` is the residual along the left singular vectors.
    """

    y: Any
    left: Float[Array, " n"]
    values: Float[Array, " n"]
    right: Float[Array, "n n"]

    @property
    def promise(self) -> Float[Array, ""]:
        """Drop of the cost (half chi-squared) that a step promises whose damping is the least tried."""
        kept = self.values**2 / (self.values**2 + _DAMPINGS[0])
        return 0.5 * jnp.sum(kept * self.left**2)


class _BestDamping(optx.AbstractDescent):
    """The best of several damped Newton steps."""

    cost: _Cost

    def init(self, y, f_info_struct) -> _Linearised:
        del f_info_struct
        flat, _ = ravel_pytree(y)
        return _Linearised(y, jnp.zeros_like(flat), jnp.ones_like(flat), jnp.eye(flat.size))

    def query(self, y, f_info, state) -> _Linearised:
        del state
        U, values, right = jnp.linalg.svd(f_info.jac.as_matrix(), full_matrices=False)
        residual, _ = ravel_pytree(f_info.residual)
        return _Linearised(y, U.T @ residual, values, right)

    def step(self, step_size, state):
        flat, as_tree = ravel_pytree(state.y)

        def reachable(unknowns: Unknowns) -> Unknowns:
            return unknowns._replace(z=self.cost.problem.bounds.reachable(unknowns.z))

        def best():
            dampings = jnp.array(_DAMPINGS)[:, None] / step_size
            steps = -(state.values * state.left / (state.values**2 + dampings)) @ state.right
            there = jax.vmap(lambda step: reachable(as_tree(flat + step)))(steps)
            costs = jax.vmap(self.cost)(there)
            best = jnp.argmin(jnp.where(jnp.isfinite(costs), costs, jnp.inf))
            return ravel_pytree(jax.tree.map(lambda leaf: leaf[best], there))[0] - flat

        step = jax.lax.cond(state.promise > _PROMISE, best, lambda: jnp.zeros_like(flat))
        return as_tree(step), optx.RESULTS.successful


class _AnyLower(optx.AbstractSearch):
    """Accept whatever lowers the cost; otherwise damp more."""

    def init(self, y, f_info_struct):
        return jnp.array(1.0)

    def step(self, first_step, y, y_eval, f_info, f_eval_info, state):
        accept = first_step | (f_eval_info.as_min() < f_info.as_min())
        step_size = jnp.where(accept, 1.0, state / _STRONGER)
        return step_size, accept, optx.RESULTS.successful, step_size


class _Progress(eqx.Module):
    """optimistix's own state, and for how many steps the cost has not fallen noticeably."""

    inner: Any
    cost: Float[Array, ""]
    stalled: Int[Array, ""]


class _Solver(optx.LevenbergMarquardt):
    """optimistix's Levenberg-Marquardt with the best of several dampings at every step.

    It also stops where no step promises anything, where none lowers the cost noticeably twice in a row, and after `limit`
    steps (a number, not a constant of the compiled program).
    """

    limit: Int[Array, ""]

    def __init__(self, cost: _Cost, tolerance, limit, verbose):
        super().__init__(rtol=1e-5, atol=tolerance, verbose=verbose)
        self.descent: Any = _BestDamping(cost)
        self.search: Any = _AnyLower()
        self.limit = limit

    def init(self, fn, y, args, options, f_struct, aux_struct, tags) -> Any:
        inner = super().init(fn, y, args, options, f_struct, aux_struct, tags)
        return _Progress(inner, jnp.array(jnp.inf), jnp.array(0))

    def step(self, fn, y, args, options, state: Any, tags) -> Any:
        y, inner, aux = super().step(fn, y, args, options, state.inner, tags)
        cost = 0.5 * sum(jnp.sum(part**2) for part in inner.f_info.residual)
        better = cost < state.cost - _NOTICEABLE
        stalled = jnp.where(better, 0, state.stalled + 1)
        return y, _Progress(inner, jnp.minimum(cost, state.cost), stalled), aux

    def terminate(self, fn, y, args, options, state: Any, tags):
        done, result = super().terminate(fn, y, args, options, state.inner, tags)
        reached = (state.inner.descent_state.promise < _PROMISE) & ~state.inner.first_step
        return done | reached | (state.stalled >= _STALLED_STEPS) | (state.inner.num_steps > self.limit), result


class Optimum(NamedTuple):
    """Where an optimisation stopped. `triangle` is the linearisation at `unknowns`."""

    unknowns: Unknowns
    triangle: Triangle
    cost: Float[Array, ""]
    iterations: Int[Array, ""]
    converged: Bool[Array, ""]

    @property
    def diverged(self) -> Bool[Array, ""]:
        """Whether the simulation is not finite even at the best point (of every lane)."""
        return ~jnp.all(jnp.isfinite(self.triangle.squares), axis=(-2, -1))


def _materialise(jac: lx.AbstractLinearOperator, unknowns: Unknowns) -> tuple[Array, Array, Array]:
    """shared, crossed and local blocks of the triangle inside optimistix's linear operator."""
    E, s = unknowns.states.shape
    n = unknowns.z.shape[0]
    zero = Unknowns(jnp.zeros(n), jnp.zeros((E, s)))
    by_z = jax.vmap(lambda t: jac.mv(zero._replace(z=t)), out_axes=-1)(jnp.eye(n))
    by_state = jax.vmap(lambda t: jac.mv(zero._replace(states=jnp.broadcast_to(t, (E, s)))), out_axes=-1)(jnp.eye(s))
    return by_z[1], by_z[0], by_state[0]


def minimise(
    structure: Structure, problem: Problem, start: Unknowns, *, max_steps=100, tolerance=1e-3, verbose=False
) -> Optimum:
    """Minimise from `start`. Pure: works under `jax.jit` and `jax.vmap` (over starts, or over whole problems).

    `verbose` is optimistix's: True, or a function that is called with every step's figures.
    """
    residual = reduced_residual(structure, problem, start)
    solver = _Solver(_Cost(structure, problem), tolerance, max_steps, verbose)
    solution = optx.least_squares(
        residual, solver, start, args=problem, has_aux=True, max_steps=None, throw=False, options={"jac": "fwd"}
    )
    state = solution.state.inner
    info = state.f_info
    local, shared, rest = info.residual
    R_shared, crossed, R_local = _materialise(info.jac, start)
    # `solution.aux` is one step behind; the state's belongs to the values returned.
    triangle = Triangle(R_shared, crossed, R_local, shared, local, rest, state.aux)
    return Optimum(
        unknowns=solution.value,
        triangle=triangle,
        cost=triangle.cost,
        iterations=state.num_steps,
        # A simulation that diverges at the start has no derivative, and the optimiser takes that for a minimum.
        converged=(solution.result == optx.RESULTS.successful)
        & (state.num_steps <= max_steps)
        & jnp.all(jnp.isfinite(triangle.squares)),
    )


_jitted = compiled(minimise, static_argnames=("structure",))
_programs: dict[Any, Any] = {}
_MOST_PROGRAMS = 32
"""Then all are forgotten, the traces they were made from too."""


def _key(structure: Structure, problem: Problem, start: Unknowns):
    leaves, tree = jax.tree.flatten((problem, start))
    return structure, tree, tuple((leaf.shape, str(leaf.dtype)) for leaf in leaves)


def compile_ahead(tasks: Sequence[tuple[Structure, Problem, Unknowns]]) -> None:
    """Compile `minimise` for several structures at once, for `minimise_compiled` to find.

    Only compilation runs in threads of its own. Programs must not run in several threads at a time: their batched LAPACK
    calls share XLA's worker threads and can wait for one another for ever.
    """
    tasks_by_key = {_key(*task): task for task in tasks}
    missing = {key: task for key, task in tasks_by_key.items() if key not in _programs}
    numbers = {"max_steps": np.int64(1), "tolerance": np.float64(1)}
    lowered = {key: _jitted.lower(*task, **numbers) for key, task in missing.items()}
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        found = dict(zip(lowered, pool.map(lambda program: program.compile(), lowered.values()), strict=True))
    if len(_programs) + len(found) > _MOST_PROGRAMS:
        _programs.clear()
        forget_programs()
    _programs.update(found)


def minimise_compiled(
    structure: Structure, problem: Problem, start: Unknowns, *, max_steps: int = 100, tolerance: float = 1e-3
) -> Optimum:
    """`minimise`, compiled once for all problems of the same structure and shapes."""
    compile_ahead([(structure, problem, start)])
    program = _programs[_key(structure, problem, start)]
    return program(problem, start, max_steps=np.int64(max_steps), tolerance=np.float64(tolerance))


@partial(compiled, static_argnames=("structure",))
def minimise_lanes(
    structure: Structure, problem: Problem, starts: Unknowns, *, max_steps=100, tolerance=1e-3
) -> Optimum:
    """`minimise` from many starts (leading axis of `starts`) in one compiled batch."""
    return jax.vmap(lambda y: minimise(structure, problem, y, max_steps=max_steps, tolerance=tolerance))(starts)
