"""Minimising an output-error problem with whatever solver: pure, compiled, and for lanes.

A solver is jaxid's `BestDampingLevenbergMarquardt` or any `optimistix.AbstractLeastSquaresSolver`, such as
`optimistix.LevenbergMarquardt(rtol=1e-8, atol=1e-8)` or `optimistix.Dogleg(...)`. optimistix's solvers know no bounds: they
move unconstrained coordinates (`Unconstrained`) and stop by their own tolerances; whether that is a minimum is judged as
for jaxid's own.
"""

from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jaxtyping import Array, Int

from ..._compile import compiled
from .in_turns import Until, minimise_in_turns
from .laid_out import runs_directly
from .lanes import Operation, all_in_lanes, ask, in_batch
from .levenberg_marquardt import BestDampingLevenbergMarquardt
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns

if TYPE_CHECKING:
    import optimistix as optx

    Solver = BestDampingLevenbergMarquardt | optx.AbstractLeastSquaresSolver
else:
    # Whoever has a solver of optimistix's has imported it; for all others that would take a tenth of jaxid's own import.
    Solver = Any
DEFAULT = BestDampingLevenbergMarquardt()


def minimise(
    structure: Structure,
    problem: Problem,
    start: Unknowns,
    *,
    max_steps: Int[Array, ""] | int = 100,
    solver: Solver = DEFAULT,
) -> Optimum:
    """Minimise from `start`. Pure: works under `jax.jit` and `jax.vmap` (over starts, or over whole problems)."""
    if isinstance(solver, BestDampingLevenbergMarquardt):
        return solver.minimise(structure, problem, start, max_steps)
    from .optimistix_solver import by_optimistix

    return by_optimistix(solver, structure, problem, start, max_steps)


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
    structure: Structure,
    problem: Problem,
    start: Unknowns,
    *,
    max_steps: int = 100,
    solver: Solver = DEFAULT,
    until: Until = 0.0,
) -> Optimum:
    """`minimise`, compiled once for all problems of the same structure and shapes; of many fits in a batch together.

    jaxid's own solver may end where a linearisation promises no drop of the cost above `until`, or where that is true of the
    cost and the promised drop; a program that holds the whole search goes on to the minimum.
    """
    ours = isinstance(solver, BestDampingLevenbergMarquardt)
    if not ours or not runs_directly(structure, problem):
        together = ask(_MINIMISE, structure, solver, problem, start, np.int64(max_steps))
        if together is not None:
            return together
    if ours:
        return minimise_in_turns(solver, structure, problem, start, max_steps, until)
    return _program(structure, problem, start, max_steps=np.int64(max_steps), solver=solver)


def minimise_each(
    structure: Structure, problem: Problem, starts: Unknowns, *, max_steps: int = 100, solver: Solver = DEFAULT
) -> Optimum:
    """`minimise` from many starts (leading axis of `starts`): in one batch, or one after another in a batch of fits."""
    each = [jax.tree.map(lambda leaf, k=k: np.asarray(leaf)[k], starts) for k in range(starts.z.shape[0])]
    jobs = {
        str(k): partial(minimise_compiled, structure, problem, start, max_steps=max_steps, solver=solver)
        for k, start in enumerate(each)
    }
    if in_batch():
        found = [job() for job in jobs.values()]
    elif isinstance(solver, BestDampingLevenbergMarquardt) and runs_directly(structure, problem):
        found = all_in_lanes(jobs)
    else:
        return minimise_lanes(structure, problem, starts, max_steps=max_steps, solver=solver)
    return jax.tree.map(lambda *leaves: np.stack(leaves), *found)


@partial(compiled, static_argnames=("structure", "solver"))
def minimise_lanes(
    structure: Structure, problem: Problem, starts: Unknowns, *, max_steps: Any = 100, solver: Solver = DEFAULT
) -> Optimum:
    """`minimise` from many starts (leading axis of `starts`) in one compiled batch."""
    return jax.vmap(lambda y: minimise(structure, problem, y, max_steps=max_steps, solver=solver))(starts)
