"""One output-error fit, by free simulation or in windows: the steps from what is asked to what is concluded.

The first minimum; the channels' noise as its residual shows it, and the minimum with these weights; the same with
integration steps that suit the robot; then the robust loss, or further rounds where the cost still falls nearby.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ...logs import LogSet
from ...parameters import ParameterError
from ...robots.robot import Robot
from ..result import Fit
from .conclude import conclude, no_priors
from .evaluation import cost_at, squares_at
from .first_minimum import first_minimum, linear_unknowns
from .from_optimum import AtBounds, channel_noise, on_bounds
from .one_way import without_what_pushes_alike
from .optimum import Optimum
from .posed import Options, Posed, posed
from .problem import DIVERGED, Problem, Structure, Unknowns
from .rescue import diverging
from .reweighted import reweighted
from .rise import Flat, rise, with_flat_sides
from .robust_loss import Robust, minimise_robustly
from .rounded_readings import beyond_rounding
from .setup import Starts
from .step_check import with_steps_checked
from .whole_turns import without_whole_turns
from .windows import Unless, condensed

_ROUNDS = 3
"""How often a fit goes on where the cost falls near its optimum."""


class _Stand(NamedTuple):
    """Where a fit stands: the model and the problem so far, its optimum, and the iterations that led there."""

    robot: Robot
    structure: Structure
    problem: Problem
    optimum: Optimum
    iterations: int


def fitted(
    robot: Robot, logs: LogSet, options: Options, start: Starts, window: float | None, unless: Unless | None = None
) -> Fit:
    """The fit of `robot` to `logs` from `start` by free simulation, or in windows of `window` seconds. Call under float64.

    Raises `Lost` where `unless` says so of the first minimum, and `ParameterError` as `output_error` does.
    """
    fit = posed(robot, logs, options, start, window)
    problem, optimum, left_out = first_minimum(fit, options, unless)
    if len(diverging(optimum)) > len(left_out):
        return _from_own_values(fit, options, start)
    nearer = without_whole_turns(fit.robot, fit.structure, problem, optimum, fit.values)
    if nearer is not None:
        optimum = options.minimise(fit.structure, problem, nearer)
    problem, optimum, iterations = _settled(fit.structure, problem, optimum, options)
    if _overflows(optimum):
        raise ParameterError(
            f"the simulation of {robot.name!r} is finite where the fit ended and its derivatives are not, as of an unstable "
            "simulation, or of a root at zero; check the logs' units and signs, or give other start values"
        )
    stand = _Stand(robot, fit.structure, problem, optimum, iterations)
    stand, error, doubt = _with_suited_steps(fit, stand, options)
    names = [fit.logs[e].name for e in left_out]
    if options.squares:
        if window is None:
            stand = _beyond_rounding(fit, stand, options)
        stand, bounded, flat = _where_nothing_falls(stand, options)
        found = with_flat_sides(_concluded(fit, stand, bounded, options, names, error), flat)
    else:
        stand, robust = _robustly(fit, stand, options)
        found = _concluded(fit, stand, _bounded(stand, options), options, names, error, robust)
    found = without_what_pushes_alike(found, logs)
    if doubt:
        found = replace(found, notes=(*found.notes, doubt))
    return found if window is None else condensed(found, logs, window)


def _beyond_rounding(fit: Posed, stand: _Stand, options: Options) -> _Stand:
    """The optimum with what coarse sensors make of the simulation on average taken out of their readings."""
    minimise = partial(options.minimise, stand.structure)
    problem, optimum = beyond_rounding(stand.structure, stand.problem, stand.optimum, fit.logs, minimise)
    return stand._replace(problem=problem, optimum=optimum)


def _from_own_values(fit: Posed, options: Options, start: Starts) -> Fit:
    """The fit from the model's own values, where the simulation diverges at another estimator's."""
    if not isinstance(start, Fit):
        raise ParameterError(
            f"the simulation of {fit.robot.name!r} diverges at the start values; check the logs' units and signs, or give "
            "other start values"
        )
    options.report(f"the simulation diverges at the result of {start.method}; starting from the model's own values")
    again = fitted(fit.robot, fit.whole, options, None, fit.window)
    note = f"The simulation diverges at the result of {start.method}; the fit started from the model's own values."
    return replace(again, notes=(*again.notes, note))


def _settled(
    structure: Structure, problem: Problem, optimum: Optimum, options: Options
) -> tuple[Problem, Optimum, int]:
    """The problem, optimum and iterations once the channels' noise has settled."""
    return reweighted(structure, problem, optimum, options.max_steps, options.report, options.solver)


def _with_suited_steps(fit: Posed, stand: _Stand, options: Options) -> tuple[_Stand, float, str]:
    """The optimum with integration steps short enough for this robot; what still depends on them (RMS, in units of the
    noise; zero where the caller chose the steps), and a sentence where that is too much."""
    if options.integrator is not None:
        return stand, 0.0, ""

    def settle(structure: Structure, problem: Problem, optimum: Optimum) -> tuple[Problem, Optimum, int]:
        return _settled(structure, problem, optimum, options)

    checked = with_steps_checked(
        stand.structure,
        stand.problem,
        stand.optimum,
        settle,
        start=fit.unknowns,
        max_steps=options.max_steps,
        solver=options.solver,
        report=options.report,
    )
    if checked.structure == stand.structure:
        return stand, checked.error, checked.note
    interval = max(log.sampling_interval for log in fit.logs)
    robot = replace(stand.robot, longest_step=interval / checked.structure.integrator.substeps)
    iterations = stand.iterations + checked.iterations
    stand = _Stand(robot, checked.structure, checked.problem, checked.optimum, iterations)
    return stand, checked.error, checked.note


def _robustly(fit: Posed, stand: _Stand, options: Options) -> tuple[_Stand, Robust]:
    """The optimum of the robust loss, from that of least squares."""
    found = minimise_robustly(
        stand.structure,
        stand.problem,
        stand.optimum,
        fit.logs,
        options.loss,
        max_steps=options.max_steps,
        solver=options.solver,
        report=options.report,
    )
    iterations = stand.iterations + found.iterations
    return stand._replace(problem=found.problem, optimum=found.optimum, iterations=iterations), found


def _overflows(optimum: Optimum) -> bool:
    """Whether derivatives of the simulation are not finite there, as where every difference grows, though it itself may be."""
    return not all(
        np.isfinite(part).all() for part in (optimum.triangle.shared, optimum.triangle.crossed, optimum.triangle.local)
    )


def _bounded(stand: _Stand, options: Options) -> AtBounds:
    return on_bounds(stand.structure, stand.problem, stand.optimum, options.max_steps, options.solver)


def _where_nothing_falls(stand: _Stand, options: Options) -> tuple[_Stand, AtBounds, dict[str, list[Flat]]]:
    """The optimum around which the cost was seen to rise: where it falls nearby, the search goes on from there."""
    bounded, flat = _bounded(stand, options), {}
    for _ in range(_ROUNDS):
        around = rise(stand.structure, stand.problem, stand.optimum, bounded)
        flat = around.flat
        if around.lower is None:
            break
        again = options.minimise(stand.structure, stand.problem, around.lower)
        if not again.cost < stand.optimum.cost or _overflows(again):
            break
        options.report("the cost falls on from there; went on")
        problem, optimum, more = _settled(stand.structure, stand.problem, again, options)
        stand = stand._replace(problem=problem, optimum=optimum, iterations=stand.iterations + more)
        bounded = _bounded(stand, options)
    return stand, bounded, flat


def _concluded(
    fit: Posed,
    stand: _Stand,
    bounded: AtBounds,
    options: Options,
    left_out: Sequence[str],
    error: float,
    robust: Robust | None = None,
) -> Fit:
    """The `Fit` with its judgement; where only the data holds the parameters, it must not be worse than its own start or
    the linear estimate."""
    structure, problem = stand.structure, stand.problem
    rivals: dict[str, Callable[[], Unknowns | None]] = {}
    if options.squares and no_priors(problem):
        rivals = {"its own start": lambda: fit.unknowns, "the linear estimate": lambda: linear_unknowns(fit, problem)}
    begun = cost_at(structure, problem, fit.unknowns)
    read: np.ndarray | None = np.asarray(fit.problem.outputs)
    scale = None if robust is None else robust.scale
    if np.array_equal(read, np.asarray(problem.outputs), equal_nan=True):
        read = None
    else:
        there = replace(problem, outputs=read)
        scale = np.asarray(channel_noise(there, squares_at(structure, there, stand.optimum.unknowns)))
    return conclude(
        stand.robot,
        fit.logs,
        structure,
        problem,
        stand.optimum if robust is None else robust.inner,
        bounded,
        iterations=stand.iterations,
        max_steps=options.max_steps,
        covariance=options.covariance,
        rivals=rivals,
        left_out=left_out,
        whole=None if fit.window is None else (fit.whole, fit.window),
        start_cost=begun if np.isfinite(begun) else DIVERGED,
        integration=error,
        read=read,
        begun=fit.values,
        bread=1.0 if robust is None else robust.bread,
        noise=scale,
        outliers=() if robust is None else robust.outliers,
    )
