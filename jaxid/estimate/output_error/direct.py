"""Simulations, costs and linearisations of an output-error problem from NumPy, in machine code alone.

The same as `problem.simulate_all`, `cost` and `linearise`, which XLA compiles for every model, every number of logs and
samples and every number of steps. Here only the robot's own machine code is made, once for all of these, so that an answer
comes seconds sooner; the Jacobian stays in the lanes in which it was simulated until it is a triangle.
"""

from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from ..._compile import compiled
from ...kernel.direct import input_tangents, one_triangle, outputs, tangents, triangle
from ...kernel.groups import grouped, ungrouped
from ...kernel.machine import lanes
from ...simulation.direct import MachineModel, machine_model
from ...simulation.records import command_slopes, commanded, commanded_each, measured, measured_each, measured_slopes
from .problem import (
    CLOCK_OFFSET,
    DIVERGED,
    Problem,
    Structure,
    Triangle,
    Unknowns,
    linearise,
    parameters_at,
    residual_weights,
    sensitivities,
    simulate_all,
)

Array = Any
"""NumPy's, or what can be read as such."""
_TOGETHER = 2_000_000
"""Numbers of the outputs up to which several simulations of the logs run side by side."""


class Direct(NamedTuple):
    """A problem in lanes: of its E logs, G groups of L lanes.

    `moving`: places of the problem's parameters among all `numbers` [P]; `starts`: those of the free initial states among
    the robot's. `u`: the inputs before any effect on commands. `weight`: of residuals, zero where nothing was measured.
    """

    model: MachineModel
    problem: Problem
    moving: tuple[int, ...]
    starts: tuple[int, ...]
    numbers: Float[Array, " P"]
    begin: Float[Array, "E S"]
    shares: Float[Array, "n L"]
    u: Float[Array, "G T 1 U L"]
    dt: Float[Array, "G T L"]
    fixed: Float[Array, "G T D L"]
    measured: Float[Array, "G T Y L"]
    weight: Float[Array, "G T Y L"]


def _model(structure: Structure, problem: Problem) -> tuple[MachineModel | None, tuple[str, ...]]:
    """The robot in machine code, None where a simulation takes XLA, and the names of its parameters."""
    names = tuple(sorted({*problem.numbers, *structure.names}))
    if CLOCK_OFFSET in structure.state_names:
        return None, names
    return machine_model(structure.robot, names, structure.integrator.friction, tuple(problem.prescribed)), names


def runs_directly(structure: Structure, problem: Problem) -> bool:
    """Whether `direct` has an answer: no simulation takes XLA. Call under float64."""
    return _model(structure, problem)[0] is not None


def direct(structure: Structure, problem: Problem) -> Direct | None:
    """`problem` in lanes; None where a simulation takes XLA. Call under float64."""
    model, names = _model(structure, problem)
    if model is None:
        return None
    problem = jax.tree.map(np.asarray, problem)
    robot, fixed = structure.robot, problem.prescribed
    E, T = problem.dt.shape
    known = np.stack([*fixed.values()], axis=-1) if fixed else np.zeros((E, T, 0))
    n = structure.integrator.substeps
    return Direct(
        model=model,
        problem=problem,
        moving=tuple(names.index(name) for name in structure.names),
        starts=tuple(robot.states.index(name) for name in structure.state_names),
        numbers=np.array([float(problem.numbers.get(name, 0.0)) for name in names]),
        begin=np.stack([np.broadcast_to(problem.start[name], E) for name in robot.states], axis=1),
        shares=np.full((n, lanes()), 1.0 / n),
        u=grouped(np.asarray(problem.inputs)[:, :, None, :]),
        dt=grouped(np.asarray(problem.dt)),
        fixed=grouped(known),
        measured=grouped(np.where(problem.mask, problem.outputs, 0.0)),
        weight=grouped(residual_weights(problem)),
    )


def _starts(d: Direct, states: Float[Array, "E s"]) -> Float[Array, "E S"]:
    x = np.array(d.begin, dtype=float)
    x[:, d.starts] += d.problem.state_scale * states
    return x


def _numbers(d: Direct, theta: Float[Array, "*c n"]) -> Float[Array, "*c P"]:
    p = np.broadcast_to(d.numbers, (*theta.shape[:-1], len(d.numbers))).copy()
    p[..., d.moving] = theta
    return p


def _seen(d: Direct, theta: Float[Array, " n"], states: Float[Array, "E s"]):
    numbers, records, n = _numbers(d, theta), d.model.records, len(d.shares)
    own = numbers[list(d.model.places)]
    p = np.broadcast_to(own[None, :, None], (len(d.u), len(own), lanes()))
    u = d.u
    if records.commands is not None:
        u = grouped(commanded(records, numbers, d.problem.inputs, d.problem.dt, n))
    return d.shares, np.ascontiguousarray(p), grouped(_starts(d, states)), u, d.dt, d.fixed


def _shown(d: Direct, theta: Float[Array, " n"], y: Float[Array, "G T Y L"]) -> Float[Array, "G T Y L"]:
    """What the sensors report of the outputs."""
    if d.model.records.measures is None:
        return y
    return grouped(measured(d.model.records, _numbers(d, theta), ungrouped(y, len(d.begin)), d.problem.dt))


def _residual(y: Float[Array, "G T Y L"], measured: Array, weight: Array) -> Float[Array, "G T Y L"]:
    residual = np.subtract(y, measured, out=y)
    residual *= weight
    # A simulation that is not finite is no matter where nothing was measured.
    return residual if np.isfinite(residual).all() else np.where(weight > 0.0, residual, 0.0)


def _tangents(d: Direct, theta: Float[Array, " n"], columns: Float[Array, " n"], seen, y) -> Float[Array, "G T Y k L"]:
    """Derivatives of what the sensors report by the initial states and by the parameters, times `columns`; `y`: the outputs
    before any effect on sensors."""
    (system, places, records), problem = d.model, d.problem
    E, n, s = len(d.begin), len(theta), len(d.starts)
    at = {place: i for i, place in enumerate(places)}
    inside = [j for j, place in enumerate(d.moving) if place in at]
    m = len(inside)
    dp, dx = np.zeros((E, s + m, m)), np.zeros((E, s + m, d.begin.shape[1]))
    dp[:, s + np.arange(m), np.arange(m)] = columns[inside]
    dx[:, np.arange(s), list(d.starts)] = np.where(problem.state_free, problem.state_scale, 0.0)
    dy = tangents(system, tuple(at[d.moving[j]] for j in inside), seen, grouped(dp), grouped(dx))
    if m < n:
        whole = np.zeros((*dy.shape[:3], s + n, lanes()))
        whole[:, :, :, [*range(s), *(s + j for j in inside)]] = dy
        dy = whole
    if records.commands is None and records.measures is None:
        return dy
    numbers, moved = _numbers(d, theta), np.zeros((n, len(d.numbers)))
    moved[np.arange(n), list(d.moving)] = columns
    before = [j for j, place in enumerate(d.moving) if place in (records.commands or ())]
    if before:
        du = command_slopes(records, numbers, problem.inputs, problem.dt, len(d.shares), moved[before])
        dy[:, :, :, [s + j for j in before]] += input_tangents(system, seen, grouped(np.moveaxis(du, 0, 3)))
    if records.measures is None:
        return dy
    steps = np.concatenate([np.zeros((s, len(d.numbers))), moved])
    return grouped(measured_slopes(records, numbers, ungrouped(y, E), problem.dt, steps, ungrouped(dy, E)))


def _whitened(d: Direct, theta: Float[Array, " n"], columns: Float[Array, " n"], states: Float[Array, "E s"]):
    """Derivatives of the weighted residuals by the initial states, by the parameters, times `columns`, and the residuals
    themselves, [G, T, Y, s + n + 1, L]."""
    seen = _seen(d, theta, states)
    with np.errstate(over="ignore", invalid="ignore"):
        y = outputs(d.model.system, seen)
        dy = _tangents(d, theta, columns, seen, y)
        both = np.empty((*dy.shape[:3], dy.shape[3] + 1, lanes()))
        np.multiply(dy, d.weight[:, :, :, None], out=both[:, :, :, :-1])
        both[:, :, :, -1] = _residual(_shown(d, theta, y), d.measured, d.weight)
    return both


def _simulated_in_lanes(d: Direct, unknowns: Unknowns) -> Float[Array, "E T Y"]:
    """`problem.simulate_all`."""
    theta = parameters_at(d.problem, np.asarray(unknowns.z))
    y = outputs(d.model.system, _seen(d, theta, np.asarray(unknowns.states)))
    return ungrouped(_shown(d, theta, y), len(d.begin))


def sensitivities_directly(
    d: Direct, theta: Float[Array, " n"], states: Float[Array, "E s"]
) -> tuple[Float[Array, "E T Y"], Float[Array, "E T Y k"]]:
    """`problem.sensitivities` at the parameters `theta`."""
    s = len(d.starts)
    both = ungrouped(_whitened(d, theta, np.ones_like(theta), states), len(d.begin))
    if not np.isfinite(both).all():
        both = np.where(ungrouped(d.weight, len(both))[..., None] > 0.0, both, 0.0)
    return both[..., -1], np.concatenate([both[..., s:-1], both[..., :s]], axis=-1)


def linearised_directly(d: Direct, unknowns: Unknowns) -> Triangle:
    """`problem.linearise`."""
    problem, E = d.problem, len(d.begin)
    z, own = np.asarray(unknowns.z), np.asarray(unknowns.states)
    n, s = len(z), len(d.starts)
    theta = parameters_at(problem, z)
    slope = np.where(problem.free, problem.bounds.slope(z), 0.0)
    block: Any = _whitened(d, theta, slope, own)
    G, T, Y, K, width = block.shape
    with np.errstate(over="ignore", invalid="ignore"):
        squares: Any = np.einsum("gtyl,gtyl->gyl", block[:, :, :, -1], block[:, :, :, -1])
    R = triangle(block.reshape(G, T * Y, K, width))
    if not np.isfinite(R).all():
        block = np.where(d.weight[:, :, :, None] > 0.0, block, 0.0)
        sound: Any = np.isfinite(block).all(axis=(1, 2, 3))[:, None, None]
        block[:, :, :, :-1] = np.where(sound[:, :, :, None], block[:, :, :, :-1], 0.0)
        block[:, :, :, -1] = np.where(sound, block[:, :, :, -1], DIVERGED)
        R = triangle(block.reshape(G, T * Y, K, width))
    if s:
        prior = np.zeros((E, s, K))
        stiff = np.where(problem.state_free, np.sqrt(problem.state_precision), 0.0) * problem.state_scale
        prior[:, np.arange(s), np.arange(s)], prior[:, :, -1] = stiff, stiff * own
        R = triangle(np.concatenate([R, grouped(prior)], axis=1))
    triangles: Any = ungrouped(R, E)
    each: Any = ungrouped(squares, E)
    pull = np.sqrt(problem.prior_precision)
    shared = np.concatenate([np.diag(pull * slope), (pull * (theta - problem.prior_mean))[:, None]], axis=1)
    shared = np.where(problem.free[:, None], shared, 0.0)
    shared_triangle: Any = one_triangle(np.concatenate([triangles[:, s:, s:].reshape(-1, n + 1), shared]))
    return Triangle(
        shared=shared_triangle[:n, :n],
        crossed=triangles[:, :s, s : s + n],
        local=triangles[:, :s, :s],
        residual_shared=shared_triangle[:n, n],
        residual_local=triangles[:, :s, -1],
        rest=shared_triangle[n:, n],
        squares=each,
    )


class SideBySide(NamedTuple):
    """The logs of a problem `together` times over, in lanes: for as many simulations of them at once."""

    together: int
    u: Float[Array, "H T 1 U L"]
    dt: Float[Array, "H T L"]
    fixed: Float[Array, "H T D L"]
    measured: Float[Array, "H T Y L"]
    weight: Float[Array, "H T Y L"]


def side_by_side(d: Direct, times: int) -> SideBySide:
    """The logs `times` times over, or once, where they are many or long."""
    E, of = len(d.begin), (d.u, d.dt, d.fixed, d.measured, d.weight)
    rows = 1 if d.model.records.commands is None else len(d.shares)
    if times == 1 or max(d.measured.size, d.u.size * rows) * times > _TOGETHER:
        return SideBySide(1, *of)
    return SideBySide(times, *(grouped(np.tile(ungrouped(x, E), (times, *[1] * (x.ndim - 2)))) for x in of))


def costs_directly(d: Direct, many: SideBySide, candidates: Unknowns) -> Float[Array, " c"]:
    """`problem.cost` at many unknowns."""
    problem, E, (system, places, records) = d.problem, len(d.begin), d.model
    theta, states = parameters_at(problem, np.asarray(candidates.z)), np.asarray(candidates.states)
    squares = []
    with np.errstate(over="ignore", invalid="ignore"):
        for first in range(0, len(theta), many.together):
            some = slice(first, first + many.together)
            numbers = _numbers(d, theta[some])
            p = grouped(np.repeat(numbers[:, places], E, axis=0))
            x = grouped(np.concatenate([_starts(d, own) for own in states[some]]))
            u = many.u
            if records.commands is not None:
                each = commanded_each(records, numbers, problem.inputs, problem.dt, len(d.shares))
                u = grouped(each.reshape(-1, *each.shape[2:]))
            y = outputs(system, (d.shares, p, x, u, many.dt, many.fixed))
            if records.measures is not None:
                plain = ungrouped(y, many.together * E)
                each = measured_each(records, numbers, plain.reshape(-1, E, *plain.shape[1:]), problem.dt)
                y = grouped(each.reshape(plain.shape))
            residual = _residual(y, many.measured, many.weight)
            each = ungrouped(np.einsum("gtyl,gtyl->gl", residual, residual), many.together * E)
            squares.append(each.reshape(many.together, E).sum(axis=1))
        pull = np.where(problem.free, problem.prior_precision, 0.0) * (theta - problem.prior_mean) ** 2
        stiff = np.where(problem.state_free, problem.state_precision * problem.state_scale**2, 0.0)
        return 0.5 * (np.concatenate(squares) + pull.sum(axis=1) + (stiff * states**2).sum(axis=(1, 2)))


_simulate_all = compiled(simulate_all, static_argnums=0)
_sensitivities = compiled(sensitivities, static_argnums=0)
_linearise = compiled(linearise, static_argnums=0)


def simulated_now(structure: Structure, problem: Problem, unknowns: Unknowns) -> Float[Array, "E T Y"]:
    """`problem.simulate_all`, directly or, where that takes XLA, as a compiled program."""
    d = direct(structure, problem)
    return np.asarray(_simulate_all(structure, problem, unknowns)) if d is None else _simulated_in_lanes(d, unknowns)


def sensitivities_now(structure: Structure, problem: Problem, unknowns: Unknowns):
    """`problem.sensitivities`, directly or as a compiled program."""
    d = direct(structure, problem)
    if d is None:
        return tuple(np.asarray(x) for x in _sensitivities(structure, problem, unknowns))
    return sensitivities_directly(d, parameters_at(d.problem, np.asarray(unknowns.z)), np.asarray(unknowns.states))


def linearised_now(structure: Structure, problem: Problem, unknowns: Unknowns) -> Triangle:
    """`problem.linearise`, directly or as a compiled program."""
    d = direct(structure, problem)
    return _linearise(structure, problem, unknowns) if d is None else linearised_directly(d, unknowns)
