r"""Integral least squares (Innocenti et al., eqs. 29-31), by QR, for any robot that is linear in its free parameters.

Two steps. The momentum balances (`regressors`) are linear and need no start values, but measured speeds multiply the
inertias in them, and noise on a regressor makes its coefficient too small. So the balances are then written as
equation 33, with the accelerations on the left and linearised about the estimate, and solved again until they stand:
there the noise of the speeds is the equation's own error. What is left of the errors in variables (noise in the
friction and caster regressors) is what output error does away with.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ..._float64 import in_float64
from ..._origin import with_origin
from ...logs import Log, LogError
from ...robots.given import check_free
from ...robots.robot import Robot
from ..judge import judged
from ..output_error.one_way import without_what_pushes_alike
from ..result import Estimate, Fit
from ..uncertainty import combinations
from ..units_doubted import with_units_doubted
from .by_speeds import by_speeds
from .judge_equations import judged_least_squares
from .linear_steps import METHOD, STEPS, estimates_of, estimates_with, identify, notes_on, status_notes, with_estimate
from .regressors import check_linear
from .weighted_least_squares import USELESS, Solution
from .window_equations import WindowEquations

_UNSETTLED = f"the equations, linearised about the estimate, did not settle in {STEPS} times"
_HELP = "Hold what the logs do not determine at known values, or take output error."


def _combinations(robot: Robot, names: tuple[str, ...], solution: Solution) -> dict[str, Estimate]:
    """Combinations with standard errors; "not_identifiable" where directions the data does not see move them."""
    numbers = robot.parameters.numbers
    known = np.where(np.isfinite(solution.covariance), solution.covariance, 0.0)
    found = combinations(robot, numbers, names, known)
    widest = combinations(robot, numbers, names, np.where(np.isfinite(solution.full), solution.full, 0.0))
    for label, wide in widest.items():
        if not wide.std_error <= USELESS * abs(wide.value):
            unknown = float("nan")
            found[label] = Estimate.of(found[label].value, unknown, found[label].unit, "not_identifiable")
    return found


@in_float64
def linear_estimate(
    robot: Robot, logs: Iterable[Log], window: int | None = None
) -> tuple[Fit, Solution, WindowEquations]:
    """Integral least squares without a judgement, which costs as much again: what other estimators start from."""
    given = list(logs)
    if not given:
        raise LogError("There are no logs to identify from; give at least one.")
    robot, speeds = by_speeds(robot, given)
    logs = list(speeds)
    check_free(robot)
    check_linear(robot, logs)
    solution, equations, iterations, stands = identify(robot, logs, window)
    names = equations.names
    identified = with_estimate(robot, names, solution.theta)
    errors = solution.errors()
    found = estimates_with(robot, names, solution.theta, errors, solution.status)
    fit = Fit(
        method=METHOD,
        robot=identified,
        parameters=estimates_of(identified, found),
        combinations=_combinations(identified, names, solution),
        free_names=names,
        covariance=np.where(solution.unseen[:, None] | solution.unseen, np.nan, solution.covariance),
        noise={
            name: float(solution.noise[i]) for i, name in enumerate(equations.speeds) if np.any(equations.equation == i)
        },
        converged=stands,
        reason="linear least squares, solved" if stands else _UNSETTLED,
        iterations=iterations,
        notes=(*notes_on(robot, equations), *status_notes(names, solution.status, errors)),
    )
    return fit, solution, equations


@with_origin
@in_float64
def integral_least_squares(
    robot: Robot,
    logs: Iterable[Log],
    *,
    window: int | None = None,
) -> Fit:
    """Fit the free parameters of `robot` to `logs` by integral least squares.

    **Arguments:**

    - `robot`: all of its equations are used (the Pioneer's equation 33 with its ym terms, the caster angle rebuilt from
      the measured speeds).
    - `window`: samples in a stretch with one unknown initial speed, which begins where the last one ended; by default
      those after which the motion has half forgotten, at least 10. Long ones average noise, short ones forget errors of
      the integrals; 2 is the paper's eq. 31: all consecutive intervals.

    Status of a parameter: "not_identifiable" if it takes part in a direction that the equations do not see (one of such
    parameters stays at the table's value, none has a standard error), or if its standard error exceeds both its estimate
    and its table value (it is estimated with the others all the same, whose intervals so know of it); "at_bound" if
    bounded least squares put it on a bound. Standard errors come from the scores' scatter in time (`score_covariance`);
    `Fit.judgement` says which parameters noise in the regressors moves by more than half of theirs (`regressor_noise`).

    Raises `LogError` for logs that hold nothing to identify from and `ParameterError` if no parameter is free or a free
    one does not enter linearly.
    """
    plain, speeds = by_speeds(robot, logs)
    fit, solution, equations = linear_estimate(plain, speeds, window)
    cut = equations.window
    del equations  # large for long logs
    fit = judged_least_squares(fit, speeds, solution, cut)
    fit = without_what_pushes_alike(with_units_doubted(fit, speeds), speeds, measured=True)
    if not fit.converged and fit.judgement is not None and fit.judgement.trustworthy:
        said = _UNSETTLED[0].upper() + _UNSETTLED[1:]
        judgement = replace(fit.judgement, better=fit.judgement.better or _HELP)
        fit = judged(fit, judgement.doubted(f"{said}: what they leave says little of the estimate."))
    return replace(fit, robot=robot.with_parameters(fit.robot.parameters))
