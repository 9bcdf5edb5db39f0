"""What unknowns cost, from machine code called from NumPy: simulations alone, of many candidates side by side in lanes."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...kernel.direct import outputs
from ...kernel.direct import squares as squares_of
from ...kernel.groups import grouped, ungrouped
from ...kernel.machine import lanes
from ...simulation.records import commanded_each, measured_each
from ...simulation.rollout import by_outputs
from .bounds import Plain
from .laid_out import Array, Direct, Logs, numbers_at, starts_at, weighted_residual
from .problem import Apart, Problem, Unknowns, parameters_at

_TOGETHER = 2_000_000
"""Numbers of the outputs up to which several simulations of the logs run side by side."""


class SideBySide(NamedTuple):
    """The logs of a problem `together` times over, in lanes: for as many simulations of them at once."""

    together: int
    logs: Logs


def side_by_side(d: Direct, times: int) -> SideBySide:
    """The logs `times` times over, or once, where they are many or long."""
    E, of = len(d.begin), d.logs
    if E % lanes() == 0:
        return SideBySide(1, of)
    rows = d.model.records.rows(d.substeps)
    # Few logs leave lanes empty, which the others' simulations fill.
    more = -(-E * times // lanes()) / len(of.dt)
    if times == 1 or (more > 1 and max(of.measured.size, of.u.size * rows) * more > _TOGETHER):
        return SideBySide(1, of)
    return SideBySide(times, Logs(*(grouped(np.tile(ungrouped(x, E), (times, *[1] * (x.ndim - 2)))) for x in of)))


def log_squares(
    d: Direct, many: SideBySide, theta: Float[Array, "c *E n"], states: Float[Array, "c E s"]
) -> Float[Array, "c E"]:
    """Sums of squared residuals of every log at c parameters, of all logs or of each, and initial states."""
    E, (system, places, records) = len(d.begin), d.model
    squares = []
    for first in range(0, len(theta), many.together):
        some = slice(first, first + many.together)
        numbers, of = numbers_at(d, theta[some]), many.logs
        each = numbers if numbers.ndim == 3 else np.repeat(numbers[:, None], E, axis=1)
        p = grouped(each[..., list(places)].reshape(-1, len(places)))
        x = grouped(starts_at(d, states[some]).reshape(-1, d.begin.shape[1]))
        u = of.u
        if records.commands is not None:
            after = commanded_each(records, numbers, d.problem.inputs, d.problem.dt, d.substeps, d.held)
            u = grouped(by_outputs(after.reshape(-1, *after.shape[2:]), d.parts))
        seen = d.shares, p, x, u, of.dt, of.fixed
        if records.measures is None:
            summed = squares_of(system, seen, of.measured, of.weight).sum(axis=1)
        else:
            plain = ungrouped(outputs(system, seen), many.together * E)
            shown = measured_each(records, numbers, plain.reshape(-1, E, *plain.shape[1:]), d.problem.dt, d.held)
            residual = weighted_residual(grouped(shown.reshape(-1, *shown.shape[2:])), of.measured, of.weight)
            summed = np.einsum("gtyl,gtyl->gl", residual, residual)
        squares.append(ungrouped(summed, many.together * E).reshape(many.together, E))
    return np.concatenate(squares)


def costs_of(
    problem: Problem | Plain, theta: Float[Array, "c n"], states: Float[Array, "c E s"], squares: Float[Array, "c E"]
) -> Apart:
    """`problem.costs_apart` at many unknowns from their logs' squares."""
    pull = np.where(problem.free, problem.prior_precision, 0.0) * (theta - problem.prior_mean) ** 2
    stiff = np.where(problem.state_free, problem.state_precision * problem.state_scale**2, 0.0)
    return Apart(0.5 * (squares + (stiff * states**2).sum(axis=2)), 0.5 * pull.sum(axis=1))


def costs_directly(d: Direct, many: SideBySide, candidates: Unknowns) -> Apart:
    """`problem.costs_apart` at many unknowns."""
    theta, states = parameters_at(d.problem, np.asarray(candidates.z)), np.asarray(candidates.states)
    with np.errstate(over="ignore", invalid="ignore"):
        return costs_of(d.problem, theta, states, log_squares(d, many, theta, states))
