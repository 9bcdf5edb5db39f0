"""Other starts, where the first led to a minimum that the noise does not explain.

From a start with too much dry friction the simulated robot never moves, and nothing tells the optimiser why; from others it
ends in a minimum that is one over some seconds only. So what is tried, one after another, until two starts agree or the
residual is down to the noise: the integral least-squares estimate, where the robot has one, the model's own values, and
starts up to ten times smaller and larger, as lanes of one program, first on a short horizon.

A minimum that is none lies where parameters have run away: all masses, frictions and gains without end are a robot without the
one inertia that is known, and no slope leads back from there, however well the logs know their sizes.
"""

from collections.abc import Callable, Mapping

import jax
import numpy as np
from jaxtyping import Array, Bool, Float

from ..._arrays import AnyArray
from ...logs import LogError, LogSet
from ...parameters import ParameterError
from ...robots.robot import Robot
from ..linear.integral_least_squares import linear_estimate
from ..result import Fit
from .globalise import horizons_of, shortened
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns, parameters_at
from .setup import start_values
from .solvers import DEFAULT, Solver, minimise_compiled, minimise_each

_POOR = 2.0
"""Root mean square of the residual, in units of the noise, above which another start is tried."""
_SAME = 0.5
"""Difference of costs (half chi-squared, in units of the residual left) within which two starts reached one minimum."""
_RUN_AWAY = 1e4
"""Times what was known of a parameter's size beforehand from which the search has run away with it."""
_LANES, _FACTOR, _SEED = 16, 10.0, 0
_SHORT_STEPS, _LONG_STEPS, _LAST_STEPS = 15, 8, 17
_AHEAD = 4
"""Lanes that go on, those that are ahead after the first long steps."""


def diverging(optimum: Optimum) -> list[int]:
    """Numbers of the logs on which the simulation is not finite."""
    return np.flatnonzero(~np.isfinite(np.asarray(optimum.triangle.squares)).all(axis=1)).tolist()


def poor(problem: Problem, optimum: Optimum) -> bool:
    """Whether the residual is far above the noise that the data shows."""
    squares, count = np.asarray(optimum.triangle.squares), int(np.sum(np.asarray(problem.mask)))
    return not float(np.sum(squares)) < _POOR**2 * count


def ran_away(problem: Problem, optimum: Optimum) -> bool:
    """Whether a parameter is larger by far than anything that was known of it."""
    theta = np.abs(np.asarray(parameters_at(problem, optimum.unknowns.z)))
    return bool(np.any(np.asarray(problem.free) & ~(theta <= _RUN_AWAY * np.asarray(problem.bounds.scale))))


def one_astray(mask: Bool[AnyArray, "E T ny"], squares: Float[AnyArray, "E ny"]) -> bool:
    """Whether a log's residual is far above the noise and above that of the others, from what was measured (`mask`) and the
    sums of squares in units of the noise.

    A caster that flips to the wrong side in one reversal holds all parameters where it does so.
    """
    counted = np.maximum(np.asarray(mask).sum(axis=1), 1)
    worst = np.max(np.sqrt(np.asarray(squares) / counted), axis=1)
    return bool(np.max(worst) > _POOR * max(float(np.median(worst)), 1.0))


def linear_start(robot: Robot, logs: LogSet, structure: Structure, problem: Problem) -> Float[Array, " n"] | None:
    """Coordinates of the integral least-squares estimate, or None where the robot or its logs have none."""
    try:
        linear = linear_estimate(robot, logs)[0].robot.parameters.numbers
    except (ParameterError, LogError):
        return None
    return problem.bounds.coordinates(np.asarray([linear[name] for name in structure.names]))


def _others(
    robot: Robot, logs: LogSet, structure: Structure, problem: Problem, start: Fit | Mapping[str, float] | None
) -> list[tuple[str, Callable[[], Float[Array, " n"] | None]]]:
    """Starts beside the first one, by words."""

    def own() -> Float[Array, " n"]:
        values = start_values(robot, None)
        return problem.bounds.coordinates(np.asarray([values[name] for name in structure.names]))

    linear = ("the linear estimate", lambda: linear_start(robot, logs, structure, problem))
    if start is None:
        return [linear]
    mine = ("the model's own values", own)
    return [mine] if isinstance(start, Fit) and start.method.startswith("integral") else [linear, mine]


def _scattered(problem: Problem, centres: list[Float[AnyArray, " n"]], states: Float[AnyArray, "E s"]) -> Unknowns:
    """Starts up to ten times smaller or larger than the given ones, turn by turn."""
    rng = np.random.default_rng(_SEED)
    theta = np.stack([np.asarray(parameters_at(problem, z)) for z in centres])
    factors = np.exp(rng.uniform(-1.0, 1.0, (_LANES, theta.shape[1])) * np.log(_FACTOR))
    z = problem.bounds.coordinates(np.resize(theta, factors.shape) * factors)
    return Unknowns(z, np.broadcast_to(np.asarray(states), (_LANES, *states.shape)))


def _costs(ends: Optimum) -> Float[np.ndarray, " lanes"]:
    """The costs of lanes; those that diverged have an infinite one."""
    return np.where(np.isfinite(ends.cost) & ~np.asarray(ends.diverged), ends.cost, np.inf)


def recovered(
    robot: Robot,
    logs: LogSet,
    structure: Structure,
    problem: Problem,
    unknowns: Unknowns,
    optimum: Optimum,
    start: Fit | Mapping[str, float] | None,
    *,
    max_steps: int,
    solver: Solver = DEFAULT,
    far_starts: bool = True,
    report: Callable[[str], None],
) -> Optimum:
    """The best minimum that other starts than `unknowns` lead to as well, or `optimum`, the first one, if it needs none: one
    that began where a fit had come to already (no `far_starts`) needs none for being on its way still."""

    def doubtful(found: Optimum) -> bool:
        astray = one_astray(problem.mask, found.triangle.squares)
        lost = far_starts and (not bool(found.converged) or ran_away(problem, found))
        return astray or lost or poor(problem, found)

    def lower(found: Optimum, than: Optimum) -> bool:
        return bool(np.isfinite(found.cost)) and not diverging(found) and not found.cost >= than.cost

    def same(found: Optimum, other: Optimum) -> bool:
        level = max(1.0, 2.0 * float(optimum.cost) / max(int(np.sum(np.asarray(problem.mask))), 1))
        return bool(found.converged) and bool(abs(found.cost - other.cost) < _SAME * level)

    if not doubtful(optimum):
        return optimum
    best = optimum
    for words, other in _others(robot, logs, structure, problem, start):
        z = other()
        if z is None:
            continue
        found = minimise_compiled(structure, problem, unknowns._replace(z=z), max_steps=max_steps, solver=solver)
        agree = same(found, best) and bool(best.converged)
        if lower(found, best):
            if not agree:
                report(f"the start led to a poor minimum; went on from {words}")
            best = found
        if agree or not doubtful(best):
            return best
    if solver is not DEFAULT or not far_starts:
        return best
    report(f"{_LANES} starts further off")
    lanes = _scattered(problem, [best.unknowns.z, unknowns.z], unknowns.states)
    for seconds in horizons_of(problem)[:1]:
        lanes = minimise_each(structure, shortened(problem, seconds), lanes, max_steps=_SHORT_STEPS).unknowns
    halfway = minimise_each(structure, problem, lanes, max_steps=_LONG_STEPS)
    ahead = np.argsort(_costs(halfway), kind="stable")[:_AHEAD]
    lanes = jax.tree.map(lambda leaf: leaf[ahead], halfway.unknowns)
    ends = minimise_each(structure, problem, lanes, max_steps=_LAST_STEPS)
    costs = _costs(ends)
    if not np.min(costs) < best.cost:
        return best
    there = jax.tree.map(lambda leaf: leaf[int(np.argmin(costs))], ends.unknowns)
    found = minimise_compiled(structure, problem, there, max_steps=max_steps)
    return found if lower(found, best) else best
