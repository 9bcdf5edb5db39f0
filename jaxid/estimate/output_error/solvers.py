"""Minimising an output-error problem with whatever solver: pure, compiled, and for lanes.

A solver is jaxid's `BestDampingLevenbergMarquardt` or any `optimistix.AbstractLeastSquaresSolver`, such as
`optimistix.LevenbergMarquardt(rtol=1e-8, atol=1e-8)` or `optimistix.Dogleg(...)`. optimistix's solvers know no bounds: they
move unconstrained coordinates (`Unconstrained`) and stop by their own tolerances; whether that is a minimum is judged as
for jaxid's own.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Int, PyTree, Scalar

from ..._arrays import array
from ..._compile import compiled
from ...kernel.machine import lanes as machine_lanes
from .bounds import Unconstrained
from .chart import chart_at
from .direct import runs_directly
from .in_turns import minimise_in_turns
from .lanes import Operation, ask, in_batch
from .levenberg_marquardt import KINK, BestDampingLevenbergMarquardt, promise_of
from .optimum import Optimum, Outcome
from .problem import Problem, Structure, Unknowns, linearise, reduced_residual

Solver = BestDampingLevenbergMarquardt | optx.AbstractLeastSquaresSolver
DEFAULT = BestDampingLevenbergMarquardt()
_SOUND = 1e50
"""Cost below which a simulation and its sensitivities are finite."""


class _Counted(NamedTuple):
    inner: Any
    steps: Int[Array, ""]


class _Limited(optx.AbstractLeastSquaresSolver):
    """A solver that also stops after `limit` steps: a number, not a constant of the compiled program."""

    rtol: float
    atol: float
    norm: Callable[[PyTree], Scalar]
    solver: Any
    limit: Int[Array, ""] | int

    def init(self, fn: Any, y: Any, args: Any, options: Any, f_struct: Any, aux_struct: Any, tags: Any) -> Any:
        return _Counted(self.solver.init(fn, y, args, options, f_struct, aux_struct, tags), jnp.array(0))

    def step(self, fn: Any, y: Any, args: Any, options: Any, state: Any, tags: Any) -> Any:
        y, inner, aux = self.solver.step(fn, y, args, options, state.inner, tags)
        return y, _Counted(inner, state.steps + 1), aux

    def terminate(self, fn: Any, y: Any, args: Any, options: Any, state: Any, tags: Any) -> Any:
        done, result = self.solver.terminate(fn, y, args, options, state.inner, tags)
        return done | (state.steps > self.limit), result

    def postprocess(
        self, fn: Any, y: Any, aux: Any, args: Any, options: Any, state: Any, tags: Any, result: Any
    ) -> Any:
        return self.solver.postprocess(fn, y, aux, args, options, state.inner, tags, result)


def _by_optimistix(
    solver: optx.AbstractLeastSquaresSolver, structure: Structure, problem: Problem, start: Unknowns, max_steps: Any
) -> Optimum:
    """Minimise with a solver of optimistix's."""
    first = linearise(structure, problem, start)
    chart = chart_at(problem.bounds, start, first)
    smooth = Unconstrained.around(problem.bounds, start.z, chart.width)
    units = chart.units.states
    residual = reduced_residual(structure, problem, start)

    def at(q: Unknowns) -> Unknowns:
        return Unknowns(smooth.to_z(q.z), start.states + units * q.states)

    def fn(q: Unknowns, args: Problem):
        return residual(at(q), args)[0]

    begin = Unknowns(smooth.from_z(start.z), jnp.zeros_like(start.states))
    limited = _Limited(solver.rtol, solver.atol, solver.norm, solver, max_steps)
    solution = optx.least_squares(fn, limited, begin, args=problem, max_steps=None, throw=False, options={"jac": "fwd"})
    there = at(solution.value)
    triangle = linearise(structure, problem, there)
    promise = promise_of(problem, there, triangle)
    sound = jnp.all(jnp.isfinite(triangle.squares)) & (triangle.cost < _SOUND)
    outcome = jnp.select(
        [~sound, promise < KINK, solution.state.steps > max_steps],
        [Outcome.DIVERGED, Outcome.OPTIMUM, Outcome.STEP_LIMIT],
        Outcome.NO_PROGRESS,
    )
    return Optimum(there, triangle, triangle.cost, solution.state.steps, outcome, first.cost, promise)


def minimise(
    structure: Structure,
    problem: Problem,
    start: Unknowns,
    *,
    max_steps: Int[Array, ""] | int = 100,
    solver: Solver = DEFAULT,
) -> Optimum:
    """Minimise from `start`. Pure: works under `jax.jit` and `jax.vmap` (over starts, or over whole problems)."""
    if isinstance(solver, optx.AbstractLeastSquaresSolver):
        return _by_optimistix(solver, structure, problem, start, max_steps)
    return solver.minimise(structure, problem, start, max_steps)


_program = compiled(minimise, static_argnames=("structure", "solver"))


def _cut(optimum: Optimum, logs: int, samples: int) -> Optimum:
    triangle = optimum.triangle
    names = ("crossed", "local", "residual_local", "squares")
    own = {name: getattr(triangle, name)[:logs] for name in names}
    unknowns = optimum.unknowns._replace(states=optimum.unknowns.states[:logs])
    return optimum._replace(unknowns=unknowns, triangle=triangle._replace(**own))


@partial(compiled, static_argnames=("structure", "solver"))
def _minimise_many(
    structure: Structure, solver: Solver, problems: Problem, starts: Unknowns, max_steps: Any
) -> Optimum:
    def one(problem: Problem, start: Unknowns, limit: Any) -> Optimum:
        return minimise(structure, problem, start, max_steps=limit, solver=solver)

    return jax.vmap(one)(problems, starts, max_steps)


_MINIMISE = Operation("minimise", _minimise_many, _cut)


def minimise_compiled(
    structure: Structure, problem: Problem, start: Unknowns, *, max_steps: int = 100, solver: Solver = DEFAULT
) -> Optimum:
    """`minimise`, compiled once for all problems of the same structure and shapes; of a fleet's members as lanes."""
    together = ask(_MINIMISE, structure, solver, problem, start, np.int64(max_steps))
    if together is not None:
        return together
    if isinstance(solver, BestDampingLevenbergMarquardt):
        return minimise_in_turns(solver, structure, problem, start, max_steps)
    return _program(structure, problem, start, max_steps=np.int64(max_steps), solver=solver)


def minimise_each(
    structure: Structure, problem: Problem, starts: Unknowns, *, max_steps: int = 100, solver: Solver = DEFAULT
) -> Optimum:
    """`minimise` from many starts (leading axis of `starts`): in one compiled batch, or one after another in a fleet, whose
    lanes are its members, and where the logs alone fill the machine code's lanes, so that nothing has to be compiled."""
    ours = isinstance(solver, BestDampingLevenbergMarquardt)
    filled = ours and 2 * problem.mask.shape[0] >= machine_lanes() and runs_directly(structure, problem)
    if not in_batch() and not filled:
        return minimise_lanes(structure, problem, starts, max_steps=max_steps, solver=solver)
    each = [jax.tree.map(lambda leaf, k=k: leaf[k], starts) for k in range(starts.z.shape[0])]
    found = [minimise_compiled(structure, problem, y, max_steps=max_steps, solver=solver) for y in each]
    return jax.tree.map(lambda *leaves: array(np.stack(leaves)), *found)


@partial(compiled, static_argnames=("structure", "solver"))
def minimise_lanes(
    structure: Structure, problem: Problem, starts: Unknowns, *, max_steps: Any = 100, solver: Solver = DEFAULT
) -> Optimum:
    """`minimise` from many starts (leading axis of `starts`) in one compiled batch."""
    return jax.vmap(lambda y: minimise(structure, problem, y, max_steps=max_steps, solver=solver))(starts)
