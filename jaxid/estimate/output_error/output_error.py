"""Output error: the parameters whose simulation comes closest to the measurement.

All free physical parameters, and each log's initial state where it is not known, minimise the simulated-minus-measured
error over all logs at once, every channel in units of its noise, which is estimated along the way. Rollouts see the
logged inputs only; no measurement is fed back, so noise on the outputs biases nothing (Ljung 1999, section 7).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._compile import seldom_collected
from ..._float64 import in_float64
from ...logs import LogError, LogSet
from ...logs.windows import in_windows
from ...parameters import ParameterError
from ...robots.closed_loop import Controller, Law, closed_loop
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ..linear.integral_least_squares import integral_least_squares
from ..result import Fit
from .conclude import Covariance, conclude, no_priors
from .from_optimum import channel_noise, on_bounds, unknown_count
from .globalise import ambiguous_index, globalise
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns
from .robust_loss import Loss, minimise_robustly
from .setup import InitialStates, build, start_values
from .solvers import minimise_compiled, minimise_lanes
from .step_check import with_steps_checked
from .window_start import started
from .windows import approached, choose, condensed

Windows = float | Literal["auto"] | None
_WEIGHT_ROUNDS = 6
_WEIGHT_SETTLED = 0.01
_POOR = 2.0
"""Root mean square of the residual, in units of the noise, above which another start is tried."""
_WORTH_A_RESCUE = 0.5

Start = Fit | Mapping[str, float] | Sequence[Mapping[str, float]] | None
Report = Callable[[str], None]


def _silent(message: str) -> None:
    pass


def _from_many(structure: Structure, problem: Problem, starts: Unknowns) -> Unknowns:
    """The best of many starts, all minimised in one compiled batch."""
    optima = minimise_lanes(structure, problem, starts, max_steps=60)
    costs = jnp.where(jnp.isfinite(optima.cost), optima.cost, jnp.inf)
    best = jnp.argmin(costs)
    return jax.tree.map(lambda x: x[best], optima.unknowns)


def _poor(problem: Problem, optimum: Optimum) -> bool:
    """Whether the residual is far above the noise that the data shows."""
    squares, count = np.asarray(optimum.triangle.squares), int(jnp.sum(problem.mask))
    return not float(np.sum(squares)) < _POOR**2 * count


def _one_astray(problem: Problem, optimum: Optimum) -> bool:
    """Whether a log's residual is far above the noise and above that of the others.

    A caster that flips to the wrong side in one reversal holds all parameters where it does so.
    """
    counted = np.maximum(np.asarray(jnp.sum(problem.mask, axis=1)), 1)
    worst = np.max(np.sqrt(np.asarray(optimum.triangle.squares) / counted), axis=1)
    return bool(np.max(worst) > _POOR * max(float(np.median(worst)), 1.0))


def _linear_start(robot: Robot, logs: LogSet, structure: Structure, problem: Problem):
    """Coordinates [n] of the integral least-squares estimate, or None where the robot or its logs have none."""
    try:
        linear = integral_least_squares(robot, logs).robot.parameters.numbers
    except (ParameterError, LogError):
        return None
    return problem.bounds.coordinates(jnp.array([linear[name] for name in structure.names]))


def _another_start(
    robot: Robot, logs: LogSet, structure: Structure, problem: Problem, start: Start, optimum: Optimum
) -> Float[Array, " n"] | None:
    """Coordinates to try as well, from where `start` has led: the linear estimate's, or, after a fit, the model's own."""
    astray = _one_astray(problem, optimum)
    if not isinstance(start, Fit):
        return _linear_start(robot, logs, structure, problem) if astray or _poor(problem, optimum) else None
    values = start_values(robot, None)
    return problem.bounds.coordinates(jnp.array([values[name] for name in structure.names])) if astray else None


def _rescued(
    structure: Structure, problem: Problem, optimum: Optimum, other: Unknowns, max_steps: int, report: Report
) -> Optimum:
    """The better of a poor minimum and the one reached from `other`.

    From a start with too much dry friction the simulated robot never moves, and nothing tells the optimiser why.
    """
    found = minimise_compiled(structure, problem, other, max_steps=max_steps)
    if not found.cost < optimum.cost - _WORTH_A_RESCUE:
        return optimum
    report("the start led to a poor minimum; went on from another one")
    return found


def reweighted(
    structure: Structure, problem: Problem, optimum: Optimum, max_steps: int, report: Report = _silent
) -> tuple[Problem, Optimum, int]:
    """Estimate every channel's noise from the residual and minimise again, until the weights settle."""
    floor = np.asarray(problem.sigma) * 1e-3
    total = int(optimum.iterations)
    for _ in range(_WEIGHT_ROUNDS):
        noise = channel_noise(problem, optimum.triangle.squares, unknown_count(structure, problem))
        sigma = np.maximum(np.asarray(noise), floor)
        change = float(np.max(np.abs(sigma / np.asarray(problem.sigma) - 1.0)))
        if change < _WEIGHT_SETTLED:
            break
        problem = replace(problem, sigma=jnp.asarray(sigma))
        optimum = minimise_compiled(structure, problem, optimum.unknowns, max_steps=max_steps)
        total += int(optimum.iterations)
        report("channel noise re-estimated")
    return problem, optimum, total


def _without(problem: Problem, logs: Sequence[int]) -> Problem:
    """The problem in which the logs of these numbers have no weight."""
    kept = np.ones(problem.mask.shape[0], dtype=bool)
    kept[list(logs)] = False
    return replace(problem, mask=problem.mask & jnp.asarray(kept)[:, None, None])


def _diverging(optimum: Optimum) -> list[int]:
    """Numbers of the logs on which the simulation is not finite."""
    return np.flatnonzero(~np.isfinite(np.asarray(optimum.triangle.squares)).all(axis=1)).tolist()


def _first_minimum(structure: Structure, problem: Problem, unknowns: Unknowns, max_steps: int):
    """The minimum, the problem, and the numbers of logs left out because the simulation diverges on them alone.

    Logs on which only the start diverges come back once the others have led to better parameters.
    """
    optimum = minimise_compiled(structure, problem, unknowns, max_steps=max_steps)
    bad = _diverging(optimum)
    if not bad or len(bad) == problem.mask.shape[0]:
        return optimum, problem, []
    rest = _without(problem, bad)
    optimum = minimise_compiled(structure, rest, unknowns, max_steps=max_steps)
    again = minimise_compiled(structure, problem, optimum.unknowns, max_steps=max_steps)
    bad = _diverging(again)
    if not bad:
        return again, problem, []
    rest = _without(problem, bad)
    return minimise_compiled(structure, rest, optimum.unknowns, max_steps=max_steps), rest, bad


def _fit(
    robot: Robot,
    logs: LogSet,
    *,
    start: Start,
    initial_states: InitialStates,
    integrator: Integrator | None,
    loss: Loss,
    covariance: Covariance,
    clock_offset: bool,
    max_steps: int,
    report: Report,
    window: float | None,
) -> Fit:
    """`output_error` by free simulation, or in windows of `window` seconds."""
    whole = logs
    if window is not None:
        logs, initial_states = in_windows(whole, window), "estimate"
    many = None
    if start is not None and not isinstance(start, Fit | Mapping):
        many = [start_values(robot, values) for values in start]
        # The middle of the starts sets the magnitudes in which all of them move: one wild start must not.
        first = {name: float(np.median([values[name] for values in many])) for name in many[0]}
    else:
        first = start_values(robot, start)
    structure, problem, unknowns = build(
        robot, logs, start=first, initial=initial_states, integrator=integrator, clock_offset=clock_offset
    )
    if window is not None:
        problem = started(robot.with_values(**first), whole, window, structure, problem)
        if many is None:
            unknowns = approached(structure, problem, unknowns)
    if loss != "squares":
        problem = replace(problem, weight=jnp.ones(problem.mask.shape))
    left_out: list[int] = []
    if many is not None:
        coordinates = [problem.bounds.coordinates(jnp.array([v[n] for n in structure.names])) for v in many]
        states = jnp.broadcast_to(unknowns.states, (len(many), *unknowns.states.shape))
        unknowns = _from_many(structure, problem, Unknowns(jnp.stack(coordinates), states))
        report(f"best of {len(many)} starts chosen")

    def linear_unknowns() -> Unknowns | None:
        z = _linear_start(robot, whole, structure, problem)
        return None if z is None else unknowns._replace(z=z)

    index = ambiguous_index(structure)
    if index is not None:
        starts = [unknowns]
        z = _linear_start(robot, whole, structure, problem)
        if z is not None:
            starts.append(unknowns._replace(z=z))
        optimum = globalise(structure, problem, starts, index, report=report)
    else:
        optimum, problem, left_out = _first_minimum(structure, problem, unknowns, max_steps)
        report("first minimum found")
        if not left_out:
            z = _another_start(robot, whole, structure, problem, start, optimum)
            if z is not None:
                optimum = _rescued(structure, problem, optimum, unknowns._replace(z=z), max_steps, report)
    diverged = len(_diverging(optimum)) > len(left_out)
    if diverged and not isinstance(start, Fit):
        raise ParameterError(
            f"the simulation of {robot.name!r} diverges at the start values; check the logs' units and signs, or give "
            "other start values"
        )
    if diverged and isinstance(start, Fit):
        report(f"the simulation diverges at the result of {start.method}; starting from the model's own values")
        again = _fit(
            robot, whole, start=None, initial_states=initial_states, integrator=integrator, loss=loss,
            covariance=covariance, clock_offset=clock_offset, max_steps=max_steps, report=report, window=window,
        )  # fmt: skip
        note = f"The simulation diverges at the result of {start.method}; the fit started from the model's own values."
        return replace(again, notes=(*again.notes, note))
    problem, optimum, iterations = reweighted(structure, problem, optimum, max_steps, report)
    doubts = ""
    if integrator is None:
        checked = with_steps_checked(structure, problem, optimum, max_steps=max_steps, report=report)
        doubts = checked.note
        if checked.structure != structure:
            structure, optimum = checked.structure, checked.optimum
            interval = max(log.sampling_interval for log in logs)
            robot = replace(robot, longest_step=interval / structure.integrator.substeps)
            problem, optimum, more = reweighted(structure, problem, optimum, max_steps, report)
            iterations += more
    inner, noise, outliers, bread = optimum, None, (), 1.0
    if loss != "squares":
        lossy = minimise_robustly(structure, problem, optimum, logs, loss, max_steps=max_steps, report=report)
        problem, optimum, inner = lossy.problem, lossy.optimum, lossy.inner
        noise, outliers, bread = lossy.scale, lossy.outliers, lossy.bread
        iterations += lossy.iterations
    bounded = on_bounds(structure, problem, optimum, max_steps)
    rivals: dict[str, Callable[[], Unknowns | None]] = {}
    if loss == "squares" and no_priors(problem):
        rivals = {"its own start": lambda: unknowns, "the linear estimate": linear_unknowns}
    found = conclude(
        robot, logs, structure, problem, inner, bounded, iterations=iterations, max_steps=max_steps, bread=bread,
        covariance=covariance, rivals=rivals, noise=noise, left_out=[logs[e].name for e in left_out], outliers=outliers,
        whole=None if window is None else (whole, window),
    )  # fmt: skip
    if doubts:
        found = replace(found, notes=(*found.notes, doubts))
    return found if window is None else condensed(found, whole, window)


@in_float64
@seldom_collected()
def output_error(
    robot: Robot,
    logs: LogSet,
    *,
    start: Start = None,
    initial_states: InitialStates = "auto",
    integrator: Integrator | None = None,
    loss: Loss = "squares",
    covariance: Covariance = "auto",
    clock_offset: bool = False,
    windows: Windows = "auto",
    controller: Controller | Law | None = None,
    max_steps: int = 100,
    report: Report = _silent,
) -> Fit:
    """Fit all free parameters of `robot` to `logs` by output error.

    **Arguments:**

    - `start`: another `Fit` (usually integral least squares), values by symbol, or a sequence of such values, which are
      minimised in one compiled batch and the best of which goes on. By default the robot's own numbers.
    - `initial_states`: "known" (at rest, or as the log says), "estimate" (free for every log), or "auto": free for logs
      that start in motion.
    - `integrator`: step and dry-friction law; by default true sticking with steps that suit the robot, shortened where the
      estimates would move with shorter ones (`step_check`).
    - `loss`: "squares", or "huber", "cauchy", "student_t" against outliers, which the result lists (`robust_loss`).
    - `clock_offset`: whether inputs and outputs may run on different clocks; every log's offset is then estimated.
    - `covariance`: of the parameters, for "white" residuals, or "robust" against coloured ones (`robust_covariance`). By
      default the residual decides, and `Fit.standard_errors` says what it was.
    - `windows`: length [s] of the windows into which every log is cut, each with an initial state of its own (multiple
      shooting without continuity), for plants that a free simulation cannot follow; None for free simulation; "auto":
      free, unless that is unpredictable or drifts and windows leave much less (`windows.choose`), which a note then says.
    - `controller`: simulate the robot in a closed loop with it, from the reference among the logs' further columns, instead
      of at the logged inputs, which then are outputs; `Fit.robot` is the `ClosedLoop` (see `closed_loop`).
    - `report`: called with a sentence whenever a stage of the work is done.

    Returns a `Fit`, whose `judgement` says what its residual says of it. A log on which alone the simulation diverges is
    left out and named in `Fit.log_status`. Raises `ParameterError` for unknown or no free parameters, and where the
    simulation diverges on every log at the start and at the integral least-squares estimate.
    """
    if controller is not None:
        robot, logs = closed_loop(robot, logs, controller)
    options: dict[str, Any] = dict(
        initial_states=initial_states, integrator=integrator, loss=loss, covariance=covariance,
        clock_offset=clock_offset, max_steps=max_steps, report=report,
    )  # fmt: skip
    if windows != "auto":
        return _fit(robot, logs, start=start, window=windows, **options)

    def once(window: float | None, start: Start) -> Fit:
        if window is not None:
            report(f"windows of {window:.3g} s")
        return _fit(robot, logs, start=start, window=window, **options)

    return choose(robot, logs, once, start)
