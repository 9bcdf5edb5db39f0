"""Minimising an output-error problem with a solver of optimistix's. Imported where somebody gives one (`solvers`)."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Int, PyTree, Scalar

from .bounds import Unconstrained
from .chart import chart_at
from .levenberg_marquardt import KINK, promise_of
from .optimum import Optimum, Outcome
from .problem import Problem, Structure, Unknowns, linearise, reduced_residual

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


def by_optimistix(
    solver: optx.AbstractLeastSquaresSolver, structure: Structure, problem: Problem, start: Unknowns, max_steps: Any
) -> Optimum:
    """Minimise with `solver`. Pure."""
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
