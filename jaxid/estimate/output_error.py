"""Output error: the parameters whose simulation comes closest to the measurement.

All free physical parameters, and each log's initial state where it is not known, minimise the simulated-minus-measured
error over all logs at once, every channel in units of its noise, which is estimated along the way. Rollouts see the
logged inputs only; no measurement is fed back, so noise on the outputs biases nothing (Ljung 1999, section 7).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np

from .._float64 import in_float64
from ..logs import LogSet
from ..parameters import ParameterError
from ..robots.robot import Robot
from ..simulate.rollout import Integrator
from .globalise import ambiguous_index, globalise
from .integral_least_squares import integral_least_squares
from .levenberg_marquardt import Optimum, minimise_compiled, minimise_lanes
from .problem import Problem, Structure, Triangle, Unknowns, parameters_at
from .result import Fit
from .robust_covariance import robust_covariance
from .setup import InitialStates, build
from .uncertainty import combinations, estimates, spread

Covariance = Literal["white", "robust"]
_WEIGHT_ROUNDS = 6
_WEIGHT_SETTLED = 0.01
_NEAR_BOUND = 0.02
_BOUND_COST = 2.0
"""Half chi-squared a parameter may cost when it is moved from near its bound onto it."""

Start = Fit | Mapping[str, float] | Sequence[Mapping[str, float]] | None
Report = Callable[[str], None]


def _silent(message: str) -> None:
    pass


def _numbers(robot: Robot, start: Fit | Mapping[str, float] | None) -> dict[str, float]:
    """Start values of the free parameters."""
    if start is None:
        return {name: robot.parameters[name].value for name in robot.parameters.free_names}
    if isinstance(start, Fit):
        values = start.robot.parameters.numbers
        return {name: values.get(name, robot.parameters[name].value) for name in robot.parameters.free_names}
    for name in start:
        robot.parameters[name]  # an unknown name is an error, not a silently ignored start
    return {**_numbers(robot, None), **{k: float(v) for k, v in start.items() if k in robot.parameters.free_names}}


def _from_many(structure: Structure, problem: Problem, starts: Unknowns) -> Unknowns:
    """The best of many starts, all minimised in one compiled batch."""
    optima = minimise_lanes(structure, problem, starts, max_steps=60)
    costs = jnp.where(jnp.isfinite(optima.cost), optima.cost, jnp.inf)
    best = jnp.argmin(costs)
    return jax.tree.map(lambda x: x[best], optima.unknowns)


def channel_noise(problem: Problem, triangle: Triangle, unknown_count: float) -> np.ndarray:
    """Standard deviation of each channel's residual at the optimum, degrees of freedom accounted for [ny]."""
    counts = np.asarray(jnp.sum(problem.mask, axis=(0, 1)), dtype=float)
    squares = np.asarray(jnp.sum(triangle.squares, axis=0))
    # The unknowns are shared among channels by their share of the samples.
    freedom = np.maximum(counts * (1.0 - unknown_count / max(counts.sum(), 1.0)), 1.0)
    sigma = np.asarray(problem.sigma)
    return np.where(counts > 0, sigma * np.sqrt(squares / freedom), sigma)


def _reweighted(structure: Structure, problem: Problem, optimum: Optimum, max_steps: int, report: Report):
    """Estimate every channel's noise from the residual and minimise again, until the weights settle."""
    unknown_count = len(structure.names) + float(jnp.sum(problem.state_free))
    floor = np.asarray(problem.sigma) * 1e-3
    total = int(optimum.iterations)
    for _ in range(_WEIGHT_ROUNDS):
        sigma = np.maximum(channel_noise(problem, optimum.triangle, unknown_count), floor)
        change = float(np.max(np.abs(sigma / np.asarray(problem.sigma) - 1.0)))
        if change < _WEIGHT_SETTLED:
            break
        problem = replace(problem, sigma=jnp.asarray(sigma))
        optimum = minimise_compiled(structure, problem, optimum.unknowns, max_steps=max_steps)
        total += int(optimum.iterations)
        report("channel noise re-estimated")
    return problem, optimum, total


def _on_bounds(structure: Structure, problem: Problem, optimum: Optimum, max_steps: int):
    """Put parameters that crept towards a bound exactly on it where that costs nothing, one set at a time."""
    lower, upper = np.asarray(problem.bounds.lower), np.asarray(problem.bounds.upper)
    scale = np.asarray(problem.bounds.scale)
    theta = np.asarray(parameters_at(problem, optimum.unknowns.z))
    low = np.isfinite(lower) & (theta - lower < _NEAR_BOUND * scale)
    high = np.isfinite(upper) & (upper - theta < _NEAR_BOUND * scale)
    near = (low | high) & np.asarray(problem.free)
    if not near.any():
        return problem, optimum, np.zeros(theta.shape, dtype=bool)
    at = np.where(low, lower, np.where(high, upper, theta))
    trial = replace(
        problem,
        free=problem.free & ~jnp.asarray(near),
        held=jnp.where(jnp.asarray(near), jnp.asarray(at), problem.held),
    )
    held = minimise_compiled(structure, trial, optimum.unknowns, max_steps=max_steps)
    if held.cost < optimum.cost + _BOUND_COST:
        return trial, held, near
    return problem, optimum, np.zeros(theta.shape, dtype=bool)


def _reason(optimum: Optimum, max_steps: int) -> str:
    if bool(optimum.converged):
        return "converged: no step changes the fit noticeably any more"
    return f"not converged in {max_steps} steps; start closer, free fewer parameters, or allow more steps"


@in_float64
def output_error(
    robot: Robot,
    logs: LogSet,
    *,
    start: Start = None,
    initial_states: InitialStates = "auto",
    integrator: Integrator | None = None,
    covariance: Covariance = "white",
    max_steps: int = 100,
    report: Report = _silent,
) -> Fit:
    """Fit all free parameters of `robot` to `logs` by output error.

    **Arguments:**

    - `start`: another `Fit` (usually integral least squares), values by symbol, or a sequence of such values, which are
      minimised in one compiled batch and the best of which goes on. By default the robot's own numbers.
    - `initial_states`: "known" (at rest, or as the log says), "estimate" (free for every log), or "auto": free for logs
      that start in motion.
    - `integrator`: step and dry-friction law; by default true sticking with steps that suit the robot.
    - `covariance`: of the parameters, for "white" residuals, or "robust" against coloured ones (`robust_covariance`).
    - `report`: called with a sentence whenever a stage of the work is done.

    Returns a `Fit`. Raises `ParameterError` for unknown or no free parameters, and where the simulation diverges at the start.
    """
    many = None
    if start is not None and not isinstance(start, Fit | Mapping):
        many = [_numbers(robot, values) for values in start]
        # The middle of the starts sets the magnitudes in which all of them move: one wild start must not.
        first = {name: float(np.median([values[name] for values in many])) for name in many[0]}
    else:
        first = _numbers(robot, start)
    structure, problem, unknowns = build(robot, logs, start=first, initial=initial_states, integrator=integrator)
    if many is not None:
        coordinates = [problem.bounds.coordinates(jnp.array([v[n] for n in structure.names])) for v in many]
        states = jnp.broadcast_to(unknowns.states, (len(many), *unknowns.states.shape))
        unknowns = _from_many(structure, problem, Unknowns(jnp.stack(coordinates), states))
        report(f"best of {len(many)} starts chosen")
    index = ambiguous_index(structure)
    if index is not None:
        linear = integral_least_squares(robot, logs).robot.parameters.numbers
        coordinates = problem.bounds.coordinates(jnp.array([linear[name] for name in structure.names]))
        starts = [unknowns, Unknowns(coordinates, unknowns.states)]
        optimum = globalise(structure, problem, starts, index, report=report)
    else:
        optimum = minimise_compiled(structure, problem, unknowns, max_steps=max_steps)
        report("first minimum found")
    if bool(optimum.diverged) and not isinstance(start, Fit):
        raise ParameterError(
            f"the simulation of {robot.name!r} diverges at the start values; check the logs' units and signs, or give "
            "other start values"
        )
    if bool(optimum.diverged) and isinstance(start, Fit):
        report(f"the simulation diverges at the result of {start.method}; starting from the model's own values")
        again = output_error(
            robot, logs, initial_states=initial_states, integrator=integrator, covariance=covariance,
            max_steps=max_steps, report=report,
        )  # fmt: skip
        note = f"The simulation diverges at the result of {start.method}; the fit started from the model's own values."
        return replace(again, notes=(*again.notes, note))
    problem, optimum, iterations = _reweighted(structure, problem, optimum, max_steps, report)
    inner = optimum
    problem, optimum, at_bound = _on_bounds(structure, problem, optimum, max_steps)
    robust = robust_covariance(structure, problem, inner.unknowns) if covariance == "robust" else None
    return _fit(robot, logs, structure, problem, inner, optimum, at_bound, iterations, max_steps, robust)


def _initial_states(robot, logs, structure, problem, optimum) -> dict[str, dict[str, float]]:
    """Every log's initial state by name, estimated where it was free."""
    values = {name: np.array(problem.start[name]) for name in robot.states}
    for i, name in enumerate(structure.state_names):
        values[name] = values[name] + np.asarray(problem.state_scale[i] * optimum.unknowns.states[:, i])
    return {log.name: {name: float(values[name][e]) for name in robot.states} for e, log in enumerate(logs)}


def _fit(robot, logs, structure, problem, inner, optimum, at_bound, iterations, max_steps, robust) -> Fit:
    names = structure.names
    theta = np.asarray(parameters_at(problem, optimum.unknowns.z))
    # Uncertainty with every parameter free: one that lies on its bound still widens the others' intervals.
    slope = np.asarray(problem.bounds.slope(inner.unknowns.z))
    jacobian = np.asarray(inner.triangle.shared) / slope
    magnitude = np.maximum(np.abs(theta), np.asarray(problem.bounds.scale))
    found = spread(jacobian, np.ones(len(names), dtype=bool), magnitude)
    if robust is not None:
        found = found._replace(covariance=robust)
    values = dict(zip(names, theta.tolist(), strict=True))
    identified = robot.with_values(**values)
    unknown_count = len(names) + float(jnp.sum(problem.state_free))
    noise = channel_noise(problem, optimum.triangle, unknown_count)
    counted = np.asarray(jnp.any(problem.mask, axis=(0, 1)))
    measured = logs[0].channels.measured
    return Fit(
        method="output_error",
        robot=identified,
        parameters=estimates(robot, values, names, found, at_bound),
        combinations=combinations(robot, identified.parameters.numbers, names, found.covariance),
        free_names=names,
        covariance=found.covariance,
        noise={c: float(noise[i]) for i, c in enumerate(measured) if counted[i]},
        converged=bool(optimum.converged),
        reason=_reason(optimum, max_steps),
        iterations=iterations,
        initial_states=_initial_states(robot, logs, structure, problem, optimum),
    )
