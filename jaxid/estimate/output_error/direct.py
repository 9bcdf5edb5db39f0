"""Simulations, sensitivities and linearisations of an output-error problem from NumPy, in machine code alone.

The same as `problem.simulate_all`, `sensitivities` and `linearise`, which XLA compiles for every model, every number of logs
and samples and every number of steps. Each sample's rows of the Jacobian are taken into a triangle as soon as they are there.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from jaxtyping import Float

from ..._compile import compiled
from ...kernel.direct import Alone, input_tangents, looked, one_triangle, outputs, rows, tangents, triangle
from ...kernel.groups import grouped, ungrouped
from ...kernel.look_kernel import MOST_OUTPUTS
from ...kernel.machine import lanes
from ...simulation.records import command_slopes, measured_slopes
from ...simulation.rollout import by_outputs
from ...simulation.segments import Rollouts, in_segments, with_states
from .bounds import Plain
from .laid_out import Array, Direct, direct, numbers_at, seen_by, shown, starts_at, weighted_residual
from .problem import (
    DIVERGED,
    Problem,
    Structure,
    Triangle,
    Unknowns,
    linearise,
    parameters_at,
    sensitivities,
    simulate_all,
)

_LONG = 16_000_000
"""Numbers of the sensitivities, lanes filled up, from which they are worked out a stretch of time after the other."""
_MOST_ALONE = 40
"""Directions up to which each is written out by itself in machine code."""
_NO_UNITS = np.zeros((0, 0, 0))


def _tangents(
    d: Direct, theta: Float[Array, "*E n"], columns: Float[Array, "*E n"], seen, y
) -> Float[Array, "G T Y k L"]:
    """Derivatives of what the sensors report by the initial states and by the parameters, times `columns`; `y`: the outputs
    before any effect on sensors."""
    (system, places, records), problem = d.model, d.problem
    E, n, s = len(d.begin), theta.shape[-1], len(d.starts)
    at = {place: i for i, place in enumerate(places)}
    inside = [j for j, place in enumerate(d.moving) if place in at]
    m = len(inside)
    dp, dx = np.zeros((E, s + m, m)), np.zeros((E, s + m, d.begin.shape[1]))
    dp[:, s + np.arange(m), np.arange(m)] = columns[..., inside]
    dx[:, np.arange(s), list(d.starts)] = d.state_slope
    dy = tangents(system, tuple(at[d.moving[j]] for j in inside), seen, grouped(dp), grouped(dx))
    if m < n:
        whole = np.zeros((*dy.shape[:3], s + n, lanes()))
        whole[:, :, :, [*range(s), *(s + j for j in inside)]] = dy
        dy = whole
    if records.commands is None and records.measures is None:
        return dy
    numbers, moved = numbers_at(d, theta), np.zeros((n, len(d.numbers)))
    moved[np.arange(n), list(d.moving)] = columns
    before = [j for j, place in enumerate(d.moving) if place in (records.commands or ())]
    if before:
        du = command_slopes(records, numbers, problem.inputs, problem.dt, d.substeps, d.held, moved[before])
        du = by_outputs(du, d.parts)
        dy[:, :, :, [s + j for j in before]] += input_tangents(system, seen, grouped(np.moveaxis(du, 0, 3)))
    if records.measures is None:
        return dy
    steps = np.concatenate([np.zeros((s, len(d.numbers))), moved])
    return grouped(measured_slopes(records, numbers, ungrouped(y, E), problem.dt, d.held, steps, ungrouped(dy, E)))


def _alone(d: Direct) -> Alone | None:
    """What the machine code of fits needs of the directions, their units left out; None where effects on whole records move,
    or the directions are many."""
    records, at = d.model.records, {place: i for i, place in enumerate(d.model.places)}
    commands = records.commands or ()
    if records.measures is not None or any(place in commands or place not in at for place in d.moving):
        return None
    if len(d.moving) + len(d.starts) > _MOST_ALONE or d.model.system.outputs > MOST_OUTPUTS:
        return None
    return Alone(tuple(at[place] for place in d.moving), d.starts, _NO_UNITS, _NO_UNITS)


def _units(d: Direct, to: Alone, columns: Float[Array, "*E n"]) -> Alone:
    if columns.ndim == 1:
        by_parameter = np.empty((len(d.logs.dt), len(columns), lanes()))
        by_parameter[:] = columns[:, None]
    else:
        by_parameter = grouped(columns)
    return to._replace(by_state=grouped(d.state_slope), by_parameter=by_parameter)


def _whitened(d: Direct, theta: Float[Array, "*E n"], columns: Float[Array, "*E n"], states: Float[Array, "E s"]):
    """Derivatives of the weighted residuals by the initial states, by the parameters, times `columns`, and the residuals
    themselves, [G, T, Y, s + n + 1, L]."""
    seen, alone = seen_by(d, theta, states), _alone(d)
    if alone is not None:
        return rows(d.model.system, seen, _units(d, alone, columns), d.logs.measured, d.logs.weight)
    with np.errstate(over="ignore", invalid="ignore"):
        y = outputs(d.model.system, seen)
        dy = _tangents(d, theta, columns, seen, y)
        both = np.empty((*dy.shape[:3], dy.shape[3] + 1, lanes()))
        np.multiply(dy, d.logs.weight[:, :, :, None], out=both[:, :, :, :-1])
        both[:, :, :, -1] = weighted_residual(shown(d, theta, y), d.logs.measured, d.logs.weight)
    return both


def _long(d: Direct, n: int) -> bool:
    """Whether sensitivities by n parameters would take too much memory at once."""
    records = d.model.records
    numbers = d.logs.measured.size * (n + len(d.starts) + 1)
    return numbers > _LONG and records.commands is None and records.measures is None


def _stretches(
    d: Direct, theta: Float[Array, "*E n"], columns: Float[Array, "*E n"], states: Float[Array, "E s"]
) -> Iterator[tuple[slice, Float[Array, "E m Y k"]]]:
    """What `_whitened` has of the samples of one stretch of time after the other: [E, m, Y, s + n + 1]."""
    system, places, _ = d.model
    (E, S), s, n = d.begin.shape, len(d.starts), theta.shape[-1]
    at = {place: i for i, place in enumerate(places)}
    inside = [j for j, place in enumerate(d.moving) if place in at]
    dp, dx = np.zeros((E, s + n, len(inside))), np.zeros((E, s + n, S))
    dp[:, [s + j for j in inside], np.arange(len(inside))] = columns[..., inside]
    dx[:, np.arange(s), list(d.starts)] = d.state_slope
    u, dt, fixed, seen, weight = (ungrouped(x, E) for x in d.logs)
    p = np.broadcast_to(numbers_at(d, theta)[..., list(places)], (E, len(places)))
    run = Rollouts(d.shares, p, starts_at(d, states), u[:, :, 0], dt, fixed)
    with np.errstate(over="ignore", invalid="ignore"):
        for part, y, dy in in_segments(system, tuple(at[d.moving[j]] for j in inside), run, dp, dx):
            own = weight[:, part, :, None]
            both = np.concatenate([dy, (y - seen[:, part])[..., None]], axis=-1) * own
            # What is not finite is no matter where nothing was measured.
            yield part, both if np.isfinite(both).all() else np.where(own > 0.0, both, 0.0)


def _long_triangles(
    d: Direct, theta: Float[Array, "*E n"], slope: Float[Array, "*E n"], states: Float[Array, "E s"]
) -> tuple[Float[Array, "E k k"], Float[Array, "E ny"]]:
    """Triangles of every log without the initial states' priors, and the squares, for `log_triangles`."""
    E, (_, T, Y, _) = len(d.begin), d.logs.measured.shape
    K = len(d.starts) + theta.shape[-1] + 1
    R, squares = np.zeros((E, K, K)), np.zeros((E, Y))
    for _, both in _stretches(d, theta, slope, states):
        squares += np.einsum("ety,ety->ey", both[..., -1], both[..., -1])
        for e in range(E):
            sound = np.isfinite(both[e]).all() and np.isfinite(R[e]).all()
            R[e] = one_triangle(np.concatenate([R[e], both[e].reshape(-1, K)])) if sound else np.nan
    lost = ~np.isfinite(R).all(axis=(1, 2))
    R[lost] = 0.0
    R[lost, -1, -1] = DIVERGED * np.sqrt(T * Y)
    return R, squares


def _simulated_in_lanes(d: Direct, unknowns: Unknowns) -> Float[Array, "E T Y"]:
    """`problem.simulate_all`."""
    theta = parameters_at(d.problem, np.asarray(unknowns.z))
    y = outputs(d.model.system, seen_by(d, theta, np.asarray(unknowns.states)))
    return ungrouped(shown(d, theta, y), len(d.begin))


def states_after(d: Direct, theta: Float[Array, " n"], states: Float[Array, "1 s"], samples: int) -> Float[Array, " S"]:
    """States of the first log so many `samples` after its begin, or at its last one."""
    y = outputs(with_states(d.model.system), seen_by(d, theta, states))
    return ungrouped(y, 1)[0, min(samples * d.parts, y.shape[1] - 1), : d.begin.shape[1]]


def sensitivities_directly(
    d: Direct, theta: Float[Array, " n"], states: Float[Array, "E s"]
) -> tuple[Float[Array, "E T Y"], Float[Array, "E T Y k"]]:
    """`problem.sensitivities` at the parameters `theta`."""
    s = len(d.starts)
    if _long(d, len(theta)):
        residual = np.empty(d.problem.outputs.shape)
        slopes = np.empty((*residual.shape, len(theta) + s))
        for part, both in _stretches(d, theta, np.ones_like(theta), states):
            residual[:, part] = both[..., -1]
            slopes[:, part, :, : len(theta)], slopes[:, part, :, len(theta) :] = both[..., s:-1], both[..., :s]
        return residual, slopes
    both = ungrouped(_whitened(d, theta, np.ones_like(theta), states), len(d.begin))
    if not np.isfinite(both).all():
        both = np.where(ungrouped(d.logs.weight, len(both))[..., None] > 0.0, both, 0.0)
    return both[..., -1], np.concatenate([both[..., s:-1], both[..., :s]], axis=-1)


def _triangles_at_once(d: Direct, theta, slope, states):
    """The same from all samples at once, in lanes."""
    block: Any = _whitened(d, theta, slope, states)
    G, T, Y, K, width = block.shape
    with np.errstate(over="ignore", invalid="ignore"):
        squares: Any = np.einsum("gtyl,gtyl->gyl", block[:, :, :, -1], block[:, :, :, -1])
    R = triangle(block.reshape(G, T * Y, K, width))
    # What is not finite is no matter where nothing was measured.
    if not np.isfinite(R).all():
        block = np.where(d.logs.weight[:, :, :, None] > 0.0, block, 0.0)
        sound: Any = np.isfinite(block).all(axis=(1, 2, 3))[:, None, None]
        block[:, :, :, :-1] = np.where(sound[:, :, :, None], block[:, :, :, :-1], 0.0)
        block[:, :, :, -1] = np.where(sound, block[:, :, :, -1], DIVERGED)
        R = triangle(block.reshape(G, T * Y, K, width))
    return R, squares


def log_triangles(
    d: Direct, theta: Float[Array, "*E n"], slope: Float[Array, "*E n"], states: Float[Array, "E s"]
) -> tuple[Float[Array, "E k k"], Float[Array, "E ny"]]:
    """Every log's part of the linearisation: the triangle of its initial states' columns, of the parameters', times
    `slope`, and of its residual, and the residual's sums of squares."""
    E, s, n = len(d.begin), len(d.starts), theta.shape[-1]
    alone = _alone(d)
    if alone is not None:
        R, squares = _triangles_on_the_way(d, alone, theta, slope, states)
    elif _long(d, n):
        R, squares = map(grouped, _long_triangles(d, theta, slope, states))
    else:
        R, squares = _triangles_at_once(d, theta, slope, states)
    if s and alone is None:
        R = triangle(np.concatenate([R, _priors(d, states, n)[:, :s]], axis=1))
    return ungrouped(R, E), ungrouped(squares, E)


def _priors(d: Direct, states: Float[Array, "E s"], n: int) -> Float[Array, "G k k L"]:
    """Triangles of the initial states' priors."""
    s = states.shape[1]
    prior = np.zeros((len(d.logs.dt), s + n + 1, s + n + 1, lanes()))
    if s:
        stiff = grouped(d.state_stiffness)
        prior[:, np.arange(s), np.arange(s)], prior[:, :s, -1] = stiff, stiff * grouped(states)
    return prior


def _triangles_on_the_way(d: Direct, alone: Alone, theta, slope, states):
    """Triangles, priors included, and squares, in lanes, from one pass that keeps nothing as long as the logs."""
    under = _priors(d, states, theta.shape[-1])
    to, seen = _units(d, alone, slope), seen_by(d, theta, states)
    R, squares = looked(d.model.system, seen, to, d.logs.measured, d.logs.weight, under)
    lost: Any = ~np.isfinite(R).all(axis=(1, 2))
    if lost.any():
        far = under.copy()
        far[:, -1, -1] = np.sqrt(far[:, -1, -1] ** 2 + DIVERGED**2 * d.logs.measured[0, :, :, 0].size)
        R = np.where(lost[:, None, None], far, R)
    return R, squares


def reduced(
    problem: Problem | Plain,
    theta: Float[Array, " n"],
    slope: Float[Array, " n"],
    triangles: Float[Array, "E k k"],
    squares: Float[Array, "E ny"],
) -> Triangle:
    """The linearisation from its logs' parts, and the parameters' prior."""
    n = len(theta)
    s = triangles.shape[-1] - n - 1
    shared = triangles[:, s:, s:].reshape(-1, n + 1)
    if problem.prior_precision.any():
        pull = np.sqrt(problem.prior_precision)
        prior = np.concatenate([np.diag(pull * slope), (pull * (theta - problem.prior_mean))[:, None]], axis=1)
        shared = np.concatenate([shared, np.where(problem.free[:, None], prior, 0.0)])
    shared_triangle: Any = one_triangle(shared)
    return Triangle(
        shared=shared_triangle[:n, :n],
        crossed=triangles[:, :s, s : s + n],
        local=triangles[:, :s, :s],
        residual_shared=shared_triangle[:n, n],
        residual_local=triangles[:, :s, -1],
        rest=shared_triangle[n:, n],
        squares=squares,
    )


def slopes_at(problem: Problem | Plain, z: Float[Array, "*c n"]) -> Float[Array, "*c n"]:
    """Derivatives of the physical parameters by the optimiser's coordinates, zero for those that are held."""
    slope = np.where(problem.free, problem.bounds.scale, 0.0)
    return slope if slope.shape == z.shape else np.broadcast_to(slope, z.shape)


def linearised_directly(d: Direct, unknowns: Unknowns) -> Triangle:
    """`problem.linearise`."""
    z = np.asarray(unknowns.z)
    theta, slope = parameters_at(d.problem, z), slopes_at(d.problem, z)
    return reduced(d.problem, theta, slope, *log_triangles(d, theta, slope, np.asarray(unknowns.states)))


_simulate_all = compiled(simulate_all, static_argnums=0)
_sensitivities = compiled(sensitivities, static_argnums=0)
_linearise = compiled(linearise, static_argnums=0)


def simulated_now(structure: Structure, problem: Problem, unknowns: Unknowns) -> Float[Array, "E T Y"]:
    """`problem.simulate_all`, directly or, where that takes XLA, as a compiled program."""
    d = direct(structure, problem, residuals=False)
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
