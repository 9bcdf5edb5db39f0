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
from jaxtyping import Array, Bool, Float, Int

from ..._compile import compiled, forget_programs
from .arrow import Arrow, damped_step, promise
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
    """Where the next steps start, the linearisation there, and what the least damped step promises."""

    y: Any
    arrow: Arrow
    promise: Float[Array, ""]


class _BestDamping(optx.AbstractDescent):
    """The best of several damped Newton steps."""

    cost: _Cost

    def init(self, y, f_info_struct) -> _Linearised:
        del f_info_struct
        E, s = y.states.shape
        n = y.z.shape[0]
        nothing = Arrow(
            jnp.zeros((E, s, s)), jnp.zeros((E, s, n)), jnp.zeros((n, n)), jnp.zeros((E, s)), jnp.zeros(n)
        )  # fmt: skip
        return _Linearised(y, nothing, jnp.zeros(()))

    def query(self, y, f_info, state) -> _Linearised:
        del state
        shared, crossed, local = _materialise(f_info.jac, y)
        residual_local, residual_shared, _ = f_info.residual
        arrow = Arrow(local, crossed, shared, residual_local, residual_shared)
        return _Linearised(y, arrow, promise(arrow, damped_step(arrow, jnp.array(_DAMPINGS[0]))))

    def step(self, step_size, state):
        def tried(damping) -> Unknowns:
            step = damped_step(state.arrow, damping)
            z = self.cost.problem.bounds.reachable(state.y.z + step.z)
            return Unknowns(z, state.y.states + step.states)

        def best() -> Unknowns:
            there = jax.vmap(tried)(jnp.array(_DAMPINGS) / step_size)
            costs = jax.vmap(self.cost)(there)
            best = jnp.argmin(jnp.where(jnp.isfinite(costs), costs, jnp.inf))
            return jax.tree.map(lambda leaf, here: leaf[best] - here, there, state.y)

        def nothing() -> Unknowns:
            return jax.tree.map(jnp.zeros_like, state.y)

        return jax.lax.cond(state.promise > _PROMISE, best, nothing), optx.RESULTS.successful


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
