"""From where an output-error optimisation stopped to a `Fit`: noise, bounds, uncertainty, initial states."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ..._arrays import AnyArray as Array
from ..._arrays import namespace
from ...logs import LogSet
from ...robots.robot import Robot
from ..result import Estimate, Fit, Outlier
from ..uncertainty import PRACTICAL, TYPICALLY, Spread, combinations, estimates, spread, with_covariance
from .magnitudes import matter_at
from .optimum import Optimum, Outcome
from .problem import CLOCK_OFFSET, Problem, Structure, Triangle, Unknowns, holding, parameters_at
from .solvers import DEFAULT, Solver, minimise_compiled

_BOUND_COST = 0.5
"""Half chi-squared that putting a parameter on its bound may cost beyond what its standard error lets expect."""
_MATTERS = 0.1
"""Share of the signal that a parameter without bounds, moved by its standard error, may make up if it is to be known."""
_FARTHEST = 1e6
"""Times what is known of a parameter's size beforehand that nothing known of it exceeds, whatever would change the
simulation: one that hardly enters it would need any number."""
_STANDS_OUT = 10.0
"""Ratio of a log's residual to the other logs' (root mean square, in units of the noise) that is worth a word."""


def channel_noise(problem: Problem, squares: Float[Array, "E ny"]) -> Float[Array, " ny"]:
    """Standard deviation of each channel's residual at the optimum, degrees of freedom accounted for [ny], from the sums of
    squares [E, ny]. Traceable."""
    xp, sigma = namespace(squares), problem.sigma
    counts = problem.mask.sum(axis=(0, 1))
    unknown_count = problem.free.shape[0] + problem.state_free.sum()
    # The unknowns are shared among channels by their share of the samples.
    freedom = xp.maximum(counts * (1.0 - unknown_count / xp.maximum(counts.sum(), 1)), 1.0)
    return xp.where(counts > 0, sigma * xp.sqrt(squares.sum(axis=0) / freedom), sigma)


class AtBounds(NamedTuple):
    """The problem and optimum with the parameters `at_bound` [n] held exactly on their bounds."""

    problem: Problem
    optimum: Optimum
    at_bound: NDArray[np.bool_]


def known_spread(problem: Problem, optimum: Optimum) -> Spread:
    """Covariance of the physical parameters with all of them free, and which of them the data determines on its own.

    A parameter is not determined if its standard error exceeds its magnitude (`_sizes`).
    """
    jacobian = np.asarray(optimum.triangle.shared) / np.asarray(problem.bounds.slope(optimum.unknowns.z))
    return spread(jacobian, np.ones(jacobian.shape[1], dtype=bool), _sizes(problem, optimum))


def _sizes(problem: Problem, optimum: Optimum) -> NDArray[np.float64]:
    """Magnitudes [n] that standard errors must not exceed: a parameter's value; of one that may take either sign, at least
    a tenth of what would change the simulation by as much as there is to simulate, if that is no monstrous number; of one
    with two bounds, at least half of what lies between them; of one on its bound, many times what is known of its size."""
    theta = np.asarray(parameters_at(problem, optimum.unknowns.z))
    lower, upper = np.asarray(problem.bounds.lower), np.asarray(problem.bounds.upper)
    matters = np.minimum(_MATTERS * matter_at(problem, optimum.triangle), _FARTHEST * np.asarray(problem.bounds.scale))
    unbounded, both = ~np.isfinite(lower) & ~np.isfinite(upper), np.isfinite(lower) & np.isfinite(upper)
    least = np.where(unbounded, matters, np.where(both, 0.5 * (upper - lower), 0.0))
    # On its bound a parameter has no size of its own; its standard error says how far from there it may be.
    known = TYPICALLY * np.asarray(problem.bounds.scale)
    least = np.where((theta <= lower) | (theta >= upper), np.maximum(known, least), least)
    return np.maximum(np.abs(theta), least)


def _expected(robot: Robot, names: Sequence[str], theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """What standard errors [n] of parameters of either sign must not exceed by the size to expect of them; no limit where none
    is known."""
    table = [robot.parameters[name] for name in names]
    typical = np.array([p.typical if p.typical and p.lower == -np.inf and p.upper == np.inf else np.inf for p in table])
    return np.maximum(np.abs(theta), TYPICALLY * typical)


def near_bounds(problem: Problem, optimum: Optimum) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.float64]]:
    """Parameters [n] on a bound, those no further than a standard error from one, and that bound."""
    theta, free = np.asarray(parameters_at(problem, optimum.unknowns.z)), np.asarray(problem.free)
    lower, upper = np.asarray(problem.bounds.lower), np.asarray(problem.bounds.upper)
    bound = np.where(theta - lower <= upper - theta, lower, upper)
    away = np.abs(theta - bound)
    found = known_spread(problem, optimum)
    errors = np.where(np.diag(found.covariance) > 0, np.sqrt(np.diag(found.covariance)), 0.0)
    on = (away == 0) & free
    return on, free & ~on & np.isfinite(bound) & (away < errors), bound


def on_bounds(
    structure: Structure, problem: Problem, optimum: Optimum, max_steps: int, solver: Solver = DEFAULT
) -> AtBounds:
    """Put parameters that cannot be told from their bound exactly on it, one after another, where that costs nothing.

    Not beside priors: where these alone say how far a parameter is from its bound, to hold it there would move what they are
    of to where no log and no prior has it.
    """
    on, near, bound = near_bounds(problem, optimum)
    current = AtBounds(problem, optimum, on)
    if np.any(np.asarray(problem.prior_precision)[np.asarray(problem.free)] > 0):
        return current
    for i in np.flatnonzero(near):
        trial = holding(current.problem, int(i), bound[i])
        held = minimise_compiled(structure, trial, current.optimum.unknowns, max_steps=max_steps, solver=solver)
        if held.cost < current.optimum.cost + 0.5 + _BOUND_COST:
            # Another one may have left its bound now that this one is held.
            theta = np.asarray(parameters_at(trial, held.unknowns.z))
            current = AtBounds(trial, held, (theta == bound) & np.asarray(problem.free))
    return current


def _reason(optimum: Optimum, max_steps: int) -> str:
    outcome = Outcome(int(optimum.outcome))
    steps = f" ({max_steps} steps)" if outcome == Outcome.STEP_LIMIT else ""
    return outcome.sentence + steps


def own_errors(triangle: Triangle, covariance_z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard errors [E, s] of the experiments' own unknowns, in units of their scale, the parameters' included."""
    errors = np.zeros(triangle.residual_local.shape)
    for e, (local, crossed) in enumerate(zip(np.asarray(triangle.local), np.asarray(triangle.crossed), strict=True)):
        inverse = np.linalg.pinv(local)
        onto = inverse @ crossed
        errors[e] = np.sqrt(np.diag(inverse @ inverse.T + onto @ covariance_z @ onto.T))
    return errors


def initial_states_at(
    robot: Robot, logs: LogSet, structure: Structure, problem: Problem, unknowns: Unknowns
) -> dict[str, dict[str, float]]:
    """Every log's initial state by name, estimated where it was free."""
    values = {name: np.array(problem.start[name]) for name in robot.states}
    for i, name in enumerate(structure.state_names):
        if name in values:
            values[name] = values[name] + np.asarray(problem.state_scale[i] * unknowns.states[:, i])
    return {log.name: {name: float(values[name][e]) for name in robot.states} for e, log in enumerate(logs)}


def _clock_offsets(logs, structure, problem, optimum, inner, covariance_z) -> dict[str, Estimate]:
    """By how much each log's input clock is ahead, where that was estimated."""
    if CLOCK_OFFSET not in structure.state_names:
        return {}
    i = structure.state_names.index(CLOCK_OFFSET)
    scale = float(problem.state_scale[i])
    errors = own_errors(inner.triangle, covariance_z)[:, i]
    values = np.asarray(optimum.unknowns.states[:, i])
    return {
        log.name: Estimate.of(scale * values[e], scale * errors[e], "s") for e, log in enumerate(logs)
    }  # fmt: skip


def _status(logs: LogSet, problem: Problem, squares: NDArray[np.float64], left_out: Sequence[str]) -> dict[str, str]:
    """What became of every log, by name."""
    counts = np.maximum(np.asarray(problem.mask).sum(axis=(1, 2)), 1)
    rms = np.sqrt(np.sum(squares, axis=1) / counts)[: len(logs)]  # a fleet's members are filled up to equal numbers
    found = {}
    weighted = np.array([log.name not in left_out for log in logs])
    for e, log in enumerate(logs):
        others = rms[weighted & (np.arange(len(rms)) != e)]
        usual = float(np.median(others)) if len(others) else 0.0
        if log.name in left_out:
            found[log.name] = "left out: the simulation diverges on it; check its units, signs and gaps"
        elif len(others) > 1 and rms[e] > _STANDS_OUT * usual > 0:
            found[log.name] = f"stands out: its residual is {rms[e] / usual:.3g} times the other logs'"
        else:
            found[log.name] = "fitted"
    return found


def vague_note(names: Sequence[str], found: Spread) -> list[str]:
    """The sentence on parameters whose standard errors are too large for their size."""
    vague = [n for n, sure, hidden in zip(names, found.determined, found.unseen, strict=True) if not (sure or hidden)]
    if not vague:
        return []
    errors = "its standard error is" if len(vague) == 1 else "their standard errors are"
    why = "as where no motion shows them apart, or the model is another"
    return [f"These logs do not determine {' and '.join(vague)}: {errors} too large, {why}."]


def unseen_note(names: Sequence[str], found: Spread) -> list[str]:
    """The sentence on parameters that only show together, or not at all."""
    unseen = [name for name, hidden in zip(names, found.unseen, strict=True) if hidden]
    if not unseen:
        return []
    what = f"do not show {unseen[0]}" if len(unseen) == 1 else f"do not show {' and '.join(unseen)} one by one"
    return [f"These logs {what}: the model predicts motion like theirs, and other motion perhaps wrongly."]


def fit_at(
    robot: Robot,
    logs: LogSet,
    structure: Structure,
    problem: Problem,
    inner: Optimum,
    bounded: AtBounds,
    *,
    iterations: int,
    max_steps: int,
    covariance: NDArray[np.float64] | None = None,
    noise: NDArray[np.float64] | None = None,
    left_out: Sequence[str] = (),
    outliers: tuple[Outlier, ...] = (),
    start_cost: float = float("nan"),
) -> Fit:
    """The `Fit` at an optimum: `inner` with every parameter free and `bounded` with those that lie on a bound held.

    `covariance` [n, n] and `noise` [ny] replace those of white residuals; `left_out` are names of logs without weight;
    `start_cost` is the cost at the start, weighted as at the optimum.
    """
    optimum, names = bounded.optimum, structure.names
    theta = np.asarray(parameters_at(bounded.problem, optimum.unknowns.z))
    # Uncertainty with every parameter free: one that lies on its bound still widens the others' intervals.
    slope = np.asarray(problem.bounds.slope(inner.unknowns.z))
    found = known_spread(problem, inner)
    covariance_z = found.covariance / np.outer(slope, slope)
    # What was put on a bound may have changed the others' sizes, and a robust covariance is a larger one.
    there, held = _sizes(bounded.problem, optimum), bounded.at_bound
    sizes = np.minimum(np.minimum(_sizes(problem, inner), there), _expected(robot, names, theta))
    # What was put on its bound had a size of its own nearby, which is none any more.
    errors = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    on_bound = ~found.unseen & (errors <= PRACTICAL * there)
    found = found._replace(determined=np.where(held, on_bound, found.determined))
    sizes = np.where(held, there, sizes)
    found = with_covariance(found, found.covariance if covariance is None else covariance, sizes)
    values = dict(zip(names, theta.tolist(), strict=True))
    identified = robot.with_values(**values)
    squares = np.asarray(optimum.triangle.squares)
    if noise is None:
        noise = np.asarray(channel_noise(bounded.problem, squares))
    counted = np.any(np.asarray(problem.mask), axis=(0, 1))
    measured = logs[0].channels.measured
    status = _status(logs, problem, np.asarray(inner.triangle.squares), left_out)
    return Fit(
        method="output_error",
        robot=identified,
        parameters=estimates(robot, values, names, found, bounded.at_bound),
        combinations=combinations(robot, identified.parameters.numbers, names, found.covariance),
        free_names=names,
        covariance=found.covariance,
        noise={c: float(noise[i]) for i, c in enumerate(measured) if counted[i]},
        converged=bool(optimum.converged),
        reason=_reason(optimum, max_steps),
        iterations=iterations,
        initial_states=initial_states_at(robot, logs, structure, problem, optimum.unknowns),
        notes=(
            *unseen_note(names, found),
            *vague_note(names, found),
            *(f"{n} {what}." for n, what in status.items() if what != "fitted"),
        ),
        log_status=status,
        clock_offsets=_clock_offsets(logs, structure, problem, optimum, inner, covariance_z),
        outliers=outliers,
        cost=float(optimum.cost),
        start_cost=start_cost,
    )
