"""Output error: the parameters whose simulation comes closest to the measurement.

All free physical parameters, and each log's initial state where it is not known, minimise the simulated-minus-measured
error over all logs at once, every channel in units of its noise, which is estimated along the way. Rollouts see the
logged inputs only; no measurement is fed back, so noise on the outputs biases nothing (Ljung 1999, section 7).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import jax
import numpy as np

from ..._arrays import array
from ..._compile import seldom_collected
from ..._float64 import in_float64
from ...logs import LogSet
from ...logs.windows import in_windows
from ...parameters import ParameterError
from ...robots.closed_loop import Controller, Law, closed_loop
from ...robots.given import check_choice, check_given
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ..result import Fit
from .conclude import Covariance, conclude, no_priors
from .from_optimum import channel_noise, on_bounds
from .globalise import ambiguous_index, globalise
from .losses import Loss, Squares, loss_named
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns
from .pure import WEIGHT_FLOOR, WEIGHT_ROUNDS, WEIGHT_SETTLED
from .rescue import diverging, linear_start, recovered
from .rise import rise, with_flat_sides
from .robust_loss import minimise_robustly
from .setup import InitialStates, StartValues, build, start_values
from .solvers import DEFAULT, Solver, minimise_compiled, minimise_each
from .step_check import with_steps_checked
from .window_start import started
from .windows import Lost, Unless, approached, choose, condensed, left_over

_ROUNDS = 3
"""How often a fit goes on where the cost falls near its optimum."""
Windows = float | Literal["auto"] | None
Starts = StartValues | Sequence[Mapping[str, float]]
Report = Callable[[str], None]


def _silent(message: str) -> None:
    pass


def _from_many(structure: Structure, problem: Problem, starts: Unknowns, solver: Solver) -> Unknowns:
    """The best of many starts, all minimised in one compiled batch."""
    optima = minimise_each(structure, problem, starts, max_steps=60, solver=solver)
    costs = np.nan_to_num(np.asarray(optima.cost), nan=np.inf)
    best = int(np.argmin(costs))
    return jax.tree.map(lambda x: array(np.asarray(x)[best]), optima.unknowns)


def reweighted(
    structure: Structure,
    problem: Problem,
    optimum: Optimum,
    max_steps: int,
    report: Report = _silent,
    solver: Solver = DEFAULT,
) -> tuple[Problem, Optimum, int]:
    """Estimate every channel's noise from the residual and minimise again, until the weights settle."""
    floor = np.asarray(problem.sigma) * WEIGHT_FLOOR
    total = int(optimum.iterations)
    for _ in range(WEIGHT_ROUNDS):
        noise = channel_noise(problem, optimum.triangle.squares)
        sigma = np.maximum(np.asarray(noise), floor)
        change = float(np.max(np.abs(sigma / np.asarray(problem.sigma) - 1.0)))
        if change < WEIGHT_SETTLED:
            break
        problem = replace(problem, sigma=array(sigma))
        optimum = minimise_compiled(structure, problem, optimum.unknowns, max_steps=max_steps, solver=solver)
        total += int(optimum.iterations)
        report("channel noise re-estimated")
    return problem, optimum, total


def _without(problem: Problem, logs: Sequence[int]) -> Problem:
    """The problem in which the logs of these numbers have no weight."""
    kept = np.ones(problem.mask.shape[0], dtype=bool)
    kept[list(logs)] = False
    return replace(problem, mask=array(np.asarray(problem.mask) & kept[:, None, None]))


def _first_minimum(structure: Structure, problem: Problem, unknowns: Unknowns, max_steps: int, solver: Solver):
    """The minimum, the problem, and the numbers of logs left out because the simulation diverges on them alone.

    Logs on which only the start diverges come back once the others have led to better parameters.
    """
    optimum = minimise_compiled(structure, problem, unknowns, max_steps=max_steps, solver=solver)
    bad = diverging(optimum)
    if not bad or len(bad) == problem.mask.shape[0]:
        return optimum, problem, []
    rest = _without(problem, bad)
    optimum = minimise_compiled(structure, rest, unknowns, max_steps=max_steps, solver=solver)
    again = minimise_compiled(structure, problem, optimum.unknowns, max_steps=max_steps, solver=solver)
    bad = diverging(again)
    if not bad:
        return again, problem, []
    rest = _without(problem, bad)
    return minimise_compiled(structure, rest, optimum.unknowns, max_steps=max_steps, solver=solver), rest, bad


def _fit(
    robot: Robot,
    logs: LogSet,
    *,
    start: Starts,
    initial_states: InitialStates,
    integrator: Integrator | None,
    loss: Loss,
    solver: Solver,
    covariance: Covariance,
    clock_offset: bool,
    max_steps: int,
    report: Report,
    window: float | None,
    unless: Unless | None = None,
) -> Fit:
    """`output_error` by free simulation, or in windows of `window` seconds.

    Raises `Lost` where `unless` says so of the first minimum.
    """
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
    if not isinstance(loss, Squares):
        problem = replace(problem, weight=array(np.ones(problem.mask.shape)))
    left_out: list[int] = []
    if many is not None:
        coordinates = [problem.bounds.coordinates(array([v[n] for n in structure.names])) for v in many]
        states = np.broadcast_to(np.asarray(unknowns.states), (len(many), *unknowns.states.shape))
        unknowns = _from_many(structure, problem, Unknowns(array(np.stack(coordinates)), array(states)), solver)
        report(f"best of {len(many)} starts chosen")

    def linear_unknowns() -> Unknowns | None:
        z = linear_start(robot, whole, structure, problem)
        return None if z is None else unknowns._replace(z=z)

    index = ambiguous_index(structure)
    if index is not None:
        starts = [unknowns]
        z = linear_start(robot, whole, structure, problem)
        if z is not None:
            starts.append(unknowns._replace(z=z))
        optimum = globalise(structure, problem, starts, index, report=report)
    else:
        optimum, problem, left_out = _first_minimum(structure, problem, unknowns, max_steps, solver)
        report("first minimum found")
        if unless is not None and unless(problem, optimum):
            raise Lost(left_over(problem, optimum, logs))
        if not left_out:
            one = start if start is None or isinstance(start, Fit | Mapping) else first
            optimum = recovered(
                robot,
                whole,
                structure,
                problem,
                unknowns,
                optimum,
                one,
                max_steps=max_steps,
                solver=solver,
                report=report,
            )
    diverged = len(diverging(optimum)) > len(left_out)
    if diverged and not isinstance(start, Fit):
        raise ParameterError(
            f"the simulation of {robot.name!r} diverges at the start values; check the logs' units and signs, or give "
            "other start values"
        )
    if diverged and isinstance(start, Fit):
        report(f"the simulation diverges at the result of {start.method}; starting from the model's own values")
        again = _fit(
            robot, whole, start=None, initial_states=initial_states, integrator=integrator, loss=loss,
            solver=solver, covariance=covariance, clock_offset=clock_offset, max_steps=max_steps, report=report, window=window,
        )  # fmt: skip
        note = f"The simulation diverges at the result of {start.method}; the fit started from the model's own values."
        return replace(again, notes=(*again.notes, note))
    problem, optimum, iterations = reweighted(structure, problem, optimum, max_steps, report, solver)
    doubts, error = "", 0.0
    if integrator is None:

        def settle(structure: Structure, problem: Problem, optimum: Optimum):
            return reweighted(structure, problem, optimum, max_steps, report, solver)

        checked = with_steps_checked(
            structure, problem, optimum, settle, start=unknowns, max_steps=max_steps, solver=solver, report=report
        )
        doubts, error = checked.note, checked.error
        if checked.structure != structure:
            structure, problem, optimum = checked.structure, checked.problem, checked.optimum
            interval = max(log.sampling_interval for log in logs)
            robot = replace(robot, longest_step=interval / structure.integrator.substeps)
            iterations += checked.iterations
    inner, noise, outliers, bread = optimum, None, (), 1.0
    if not isinstance(loss, Squares):
        lossy = minimise_robustly(
            structure, problem, optimum, logs, loss, max_steps=max_steps, solver=solver, report=report
        )
        problem, optimum, inner = lossy.problem, lossy.optimum, lossy.inner
        noise, outliers, bread = lossy.scale, lossy.outliers, lossy.bread
        iterations += lossy.iterations
    bounded, flat = on_bounds(structure, problem, optimum, max_steps, solver), {}
    for _ in range(_ROUNDS if isinstance(loss, Squares) else 0):
        around = rise(structure, problem, optimum, bounded)
        flat = around.flat
        if around.lower is None:
            break
        again = minimise_compiled(structure, problem, around.lower, max_steps=max_steps, solver=solver)
        if not again.cost < optimum.cost:
            break
        report("the cost falls on from there; went on")
        problem, optimum, more = reweighted(structure, problem, again, max_steps, report, solver)
        inner, iterations = optimum, iterations + more
        bounded = on_bounds(structure, problem, optimum, max_steps, solver)
    begun = minimise_compiled(structure, problem, unknowns, max_steps=0)
    rivals: dict[str, Callable[[], Unknowns | None]] = {}
    if isinstance(loss, Squares) and no_priors(problem):
        rivals = {"its own start": lambda: unknowns, "the linear estimate": linear_unknowns}
    found = conclude(
        robot, logs, structure, problem, inner, bounded, iterations=iterations, max_steps=max_steps, bread=bread,
        covariance=covariance, rivals=rivals, noise=noise, left_out=[logs[e].name for e in left_out], outliers=outliers,
        whole=None if window is None else (whole, window), start_cost=float(begun.cost),
        integration=error,
        begun=first,
    )  # fmt: skip
    found = with_flat_sides(found, flat)
    if doubts:
        found = replace(found, notes=(*found.notes, doubts))
    return found if window is None else condensed(found, whole, window)


@in_float64
@seldom_collected()
def output_error(
    robot: Robot,
    logs: LogSet,
    *,
    start: Starts = None,
    initial_states: InitialStates = "auto",
    integrator: Integrator | None = None,
    loss: Loss | str = "squares",
    solver: Solver = DEFAULT,
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
    - `loss`: "squares", or "huber", "cauchy", "student_t" against outliers, which the result lists; or a `Loss` of your own
      (`losses`).
    - `solver`: the optimiser; any `optimistix` least-squares solver can take the place of jaxid's own (`solvers`). Only
      the search for a start (short horizons, an unknown angle's grid) is always by jaxid's own.
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
    check_given(robot, logs)
    check_choice("initial_states", initial_states, InitialStates)
    check_choice("covariance", covariance, Covariance)
    options: dict[str, Any] = dict(
        initial_states=initial_states, integrator=integrator, loss=loss_named(loss), solver=solver, covariance=covariance,
        clock_offset=clock_offset, max_steps=max_steps, report=report,
    )  # fmt: skip
    if windows != "auto":
        return _fit(robot, logs, start=start, window=windows, **options)

    def once(window: float | None, start: Starts, unless: Unless | None = None) -> Fit:
        if window is not None:
            report(f"windows of {window:.3g} s")
        return _fit(robot, logs, start=start, window=window, unless=unless, **options)

    return choose(robot, logs, once, start)
