r"""Instrumental variables: least squares' honest form where noise is in the regressors.

Measured speeds stand in the regressors of the linear equations, and their noise biases least squares. The regressors of a
*simulated* motion are right as well, up to the model's errors, and know nothing of the noise: as instruments Z they
give theta from Z^T (y - F theta) = 0 without bias (A. Janot, P. O. Vandanjon and M. Gautier, "A generic instrumental
variable approach for industrial robot identification", IEEE Transactions on Control Systems Technology 22, 2014). The
model that is simulated is the last pass's; least squares starts. `refined_instruments` has the equations.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr as pivoted_qr

from ..._distributions import chi_squared_beyond
from ..._float64 import in_float64
from ..._origin import with_origin
from ...logs import Log, LogError, LogSet
from ...robots.given import check_free
from ...robots.robot import Robot
from ..judge import judged
from ..output_error.one_way import without_what_pushes_alike
from ..result import Fit, Status
from ..uncertainty import combinations
from ..units_doubted import with_units_doubted
from .by_speeds import by_speeds
from .coupled_noise import noise_weights
from .integral_least_squares import linear_estimate
from .judge_equations import judged_equations, judged_instruments
from .linear_steps import estimates_of, estimates_with, status_notes, with_estimate
from .log_rows import gather, measured_speeds
from .memory import memory
from .position_slopes import whole_slopes
from .refined_instruments import Instruments, refined_instruments
from .regressors import check_linear
from .score_covariance import score_covariance, stationary_covariance, widened
from .simulated_motion import followed_simulation
from .weighted_least_squares import USELESS, known_size, statuses, unseen_of

Array = NDArray[np.float64]
METHOD = "instrumental_variables"
_PASSES = 12
_CHOSEN = 4
"""Passes after which the simulated motion and the intervals stay those of the last one."""
_SETTLED = 0.02
"""Standard errors that the estimate may still move by."""
_RANK = 1e-7
_WEAK = 0.5
"""Share of a combination of the measured regressors that the instruments must explain: with half or less, as much of what
is compared is noise as is motion, and the estimate leans towards least squares (Staiger and Stock, Econometrica 65, 1997)."""

_OTHERS = "Output error and prediction error need no instruments."
_FEW = 3
"""Degrees of freedom for each parameter, below which the scores' scatter is no measure of the uncertainty."""
_CHANCE = 0.05


@dataclass(frozen=True)
class _Solved:
    theta: Array
    covariance: Array  # NaN where there is none
    errors: Array  # standard errors; NaN also at bounds
    status: tuple[Status, ...]
    noise: Array  # by measured speed
    relevance: float
    weakest: int


def _without_starts(table: Array, found: Instruments) -> Array:
    """Columns [K, m] with what the noise at the start of every run explains taken out."""
    runs = int(found.run.max()) + 1
    power = np.bincount(found.run, weights=found.start**2, minlength=runs)
    taken = [np.bincount(found.run, weights=found.start * column, minlength=runs) / power for column in table.T]
    return table - found.start[:, None] * np.stack(taken, axis=1)[found.run]


def _relevance(F: Array, Z: Array) -> tuple[float, int]:
    """Smallest squared canonical correlation between regressors and instruments, and the column that it is about most."""
    QF, RF = np.linalg.qr(F / np.maximum(np.linalg.norm(F, axis=0), 1e-300))
    QZ, _ = np.linalg.qr(Z / np.maximum(np.linalg.norm(Z, axis=0), 1e-300))
    U, singular, _ = np.linalg.svd(QF.T @ QZ)
    direction = np.linalg.lstsq(RF, U[:, -1], rcond=None)[0]
    return float(singular[-1] ** 2), int(np.argmax(np.abs(direction)))


def _concentrated(found: Instruments, Z: Array, residual: Array, leverage: Array, inverse: Array) -> Array:
    """Factors [n, n] by which a covariance grows where residuals are larger at the samples that tell a parameter.

    A caster's noise acts while it turns, where alone its friction shows. Squares of single residuals, each of what a fit
    without it would leave (J. G. MacKinnon and H. White, Journal of Econometrics 29, 1985: HC3), against their mean.
    """
    squares, kinds = (residual / np.maximum(1.0 - leverage, 0.5)) ** 2, found.equation
    mean = np.bincount(kinds, squares) / np.maximum(np.bincount(kinds), 1)
    each, alike = (inverse @ (Z.T * power) @ Z @ inverse.T for power in (squares, mean[kinds]))
    ratio = np.sqrt(np.maximum(np.diag(each) / np.maximum(np.diag(alike), 1e-300), 1.0))
    return np.outer(ratio, ratio)


def _grown(covariance: Array, other: Array) -> Array:
    """The covariance with every standard error at least that of the other."""
    ratio = np.sqrt(np.maximum(np.diag(other) / np.maximum(np.diag(covariance), 1e-300), 1.0))
    return covariance * np.outer(ratio, ratio)


def _covariance(
    found: Instruments,
    F: Array,
    Z: Array,
    residual: Array,
    prior: Array,
    inverse: Array,
    whole: Array,
    noise: Array,
    remembered: int,
    taken: Array,
) -> Array:
    """Sandwich [n, n] around the covariance of Z^T residual: that of stationary noise, in the equations of its own speed and
    of the others, widened where the scores' own scatter in time is larger (residuals that depend on what the robot does).

    `inverse` is that of the moments' derivative by the regressors, `whole` with the positions that the estimate moves: where
    the latter says more, that is taken."""
    weights = noise_weights(found.coupling, Z, noise, found.equation, found.sample)
    middle, own = stationary_covariance(weights, residual, found.equation, found.sample, found.logs, taken)
    middle += np.diag(prior)
    spread = _grown(widened(inverse @ middle @ inverse.T, own), widened(whole @ middle @ whole.T, own))
    leverage = np.sum((F @ inverse) * Z, axis=1)
    spread = spread * _concentrated(found, Z, residual, leverage, inverse)
    scores = np.zeros((len(found.logs), Z.shape[1]))
    np.add.at(scores, found.sample, Z * residual[:, None])
    scatter, degrees = score_covariance(scores, found.logs, remembered)
    if degrees < _FEW * Z.shape[1]:
        return spread
    other = inverse @ (scatter + np.diag(prior)) @ inverse.T
    # The scatter is roughly known, so it counts where it is larger by more than chance.
    chance = degrees / float(chi_squared_beyond(1.0 - _CHANCE, degrees))
    return _grown(spread, other / chance)


def _solve(
    found: Instruments, robot: Robot, names: tuple[str, ...], noise: Array, remembered: int, slopes: Array | None = None
) -> _Solved:
    """Solve Z^T (y - F theta) = 0 with bounds and priors; `slopes` as by `whole_slopes`, if known.

    Held at the table's value is what the instruments do not contain, or not beside the others. The covariance is that of
    all others together, those at a bound included.
    """
    table = [robot.parameters[name] for name in names]
    default = np.array([p.value for p in table])
    lower, upper = np.array([p.lower for p in table]), np.array([p.upper for p in table])
    mean = np.array([p.prior[0] if p.prior else 0.0 for p in table])
    prior = np.array([p.prior[1] ** -2.0 if p.prior else 0.0 for p in table])
    n, kinds = len(names), len(noise)
    held, bound = np.zeros(n, bool), np.zeros(n, bool)
    theta, covariance, size = default.copy(), np.full((n, n), np.nan), np.zeros(n)
    unseen, relevance, weakest = np.zeros(n, bool), 0.0, 0
    followed = found.regressors if slopes is None else slopes
    table_of_rows = np.concatenate([found.regressors, found.instruments, followed, found.targets[:, None]], axis=1)
    table_of_rows = _without_starts(table_of_rows, found)
    for _ in range(3 * n + 12):
        columns = table_of_rows / noise[found.equation, None]
        F, Z, y = columns[:, :n], columns[:, n : 2 * n], columns[:, -1]
        S = columns[:, 2 * n : 3 * n]
        scale = np.sqrt(np.sum(Z * Z, axis=0) + prior)
        held |= scale == 0
        seen = np.flatnonzero(~held)
        stacked = np.concatenate([Z, np.diag(np.sqrt(prior))])[:, seen] / np.where(scale > 0, scale, 1.0)[seen]
        if len(seen):
            order = np.asarray(pivoted_qr(stacked, mode="economic", pivoting=True)[-1], dtype=int)
            diagonal = np.abs(np.diag(np.linalg.qr(stacked[:, order], mode="r")))
            follows = seen[order[: len(diagonal)][diagonal < _RANK]]
            if len(follows):
                held[follows] = True
                continue
        s = scale[seen]
        matrix = (Z[:, seen].T @ F[:, seen] + np.diag(prior[seen])) / np.outer(s, s)
        right = (Z[:, seen].T @ (y - F[:, held] @ default[held]) + prior[seen] * mean[seen]) / s
        if len(seen) and (not np.isfinite(matrix).all() or np.linalg.cond(matrix) > 1.0 / _RANK**2):
            held[seen[np.argmin(np.abs(np.diag(matrix)))]] = True
            continue
        free = ~bound[seen]
        theta[held] = default[held]
        inside = matrix[np.ix_(free, free)]
        if free.any() and np.linalg.cond(inside) <= 1.0 / _RANK**2:
            known = matrix[np.ix_(free, ~free)] @ (theta * scale)[seen[~free]]
            theta[seen[free]] = np.linalg.solve(inside, right[free] - known) / s[free]
        outside = seen[free & ((theta[seen] < lower[seen]) | (theta[seen] > upper[seen]))]
        if len(outside):
            theta[outside] = np.clip(theta[outside], lower[outside], upper[outside])
            bound[outside] = True
            continue
        residual = y - F @ theta
        before = noise
        runs = [len(np.unique(found.run[found.equation == i])) for i in range(kinds)]
        count = np.array([np.sum(found.equation == i) for i in range(kinds)])
        squares = np.array([np.sum(residual[found.equation == i] ** 2) for i in range(kinds)])
        freedom = np.maximum(count - runs - len(seen) * count / max(count.sum(), 1), 1.0)
        noise = np.where(squares > 0, noise * np.sqrt(squares / freedom), noise)
        if np.max(np.abs(noise / before - 1.0)) > 0.02:
            continue
        if not len(seen):
            break
        inverse = np.linalg.inv(matrix) / s[:, None]
        matrix = (Z[:, seen].T @ S[:, seen] + np.diag(prior[seen])) / np.outer(s, s)
        known = np.isfinite(matrix).all() and np.linalg.cond(matrix) <= 1.0 / _RANK**2
        whole = np.linalg.inv(matrix) / s[:, None] if known else inverse
        spread = _covariance(
            found,
            F[:, seen],
            Z[:, seen] / s,
            residual,
            prior[seen] / s**2,
            inverse,
            whole,
            noise,
            remembered,
            count - freedom,
        )
        covariance[np.ix_(seen, seen)] = spread
        size = known_size(theta, default, F, y)
        unseen = unseen_of(Z, prior, size)
        told = seen[np.sqrt(np.diag(spread)) <= USELESS * size[seen]]
        if len(told):
            # What the data says nothing about may have instruments as weak as it likes: its interval says so.
            relevance, weakest = _relevance(F[:, told], Z[:, told])
            weakest = int(told[weakest])
        break
    unseen = unseen | held
    covariance = np.where(unseen[:, None] | unseen, np.nan, covariance)
    errors = np.sqrt(np.diag(covariance))
    status = statuses(theta, errors, size, unseen, bound)
    return _Solved(theta, covariance, np.where(bound, np.nan, errors), status, noise, relevance, weakest)


def _followed(logs: LogSet, simulated: list[Array], moving: tuple[str, ...]) -> float:
    """Share of the measured speeds' squares that the simulation explains, of the worst speed that moves."""
    shares = []
    for name in moving:
        column = logs.channels.measured.index(name)
        measured = np.concatenate([log.outputs[:, column] for log in logs])
        seen = np.isfinite(measured)
        error = (np.concatenate([y[:, column] for y in simulated]) - measured)[seen]
        if seen.any():
            shares.append(1.0 - float(error @ error) / float(measured[seen] @ measured[seen]))
    return max(min(shares, default=0.0), 0.0)


def _errors(found: Instruments, theta: Array, speeds: tuple[str, ...]) -> dict[str, list[Array]]:
    """What the equations of every speed leave, [T] of each log, NaN where there is none."""
    columns = _without_starts(np.concatenate([found.regressors, found.targets[:, None]], axis=1), found)
    residual = columns[:, -1] - columns[:, :-1] @ theta
    parts = {}
    for i, name in enumerate(speeds):
        rows = found.equation == i
        if rows.any():
            values = np.full(len(found.logs), np.nan)
            values[found.sample[rows]] = residual[rows]
            parts[name] = [values[found.logs == number] for number in np.unique(found.logs)]
    return parts


@with_origin
@in_float64
def instrumental_variables(robot: Robot, logs: Iterable[Log], start: Fit | None = None) -> Fit:
    """Fit the free parameters of `robot` to `logs` by refined instrumental variables.

    Needs what `integral_least_squares` needs: measured states, and parameters that enter the equations of motion
    linearly. `start` is an estimate to begin from (integral least squares by default). Each pass simulates the last
    one's model with the logs' inputs, takes its regressors as instruments for the measured ones, and solves; it ends
    when the estimate moves by less than 0.02 standard errors.

    Unbiased with noise in the regressors, as long as the simulation follows the motion: instruments that explain half
    of the measured regressors or less are weak, and the result says so and is not converged. Standard errors hold for
    coloured residuals (`score_covariance`). docs/uncertainty.md has its bias and coverage beside the other estimators'.

    Status of a parameter as in `integral_least_squares`.

    Raises `LogError` for logs that hold nothing to identify from and `ParameterError` if no parameter is free or a free
    one does not enter linearly.
    """
    given, (robot, logs) = robot, by_speeds(robot, logs)
    check_free(robot)
    names = robot.parameters.free_names
    if start is None:
        start = linear_estimate(robot, logs)[0]  # checks the same
    else:
        check_linear(robot, logs)
    speeds = measured_speeds(robot)
    rows = gather(robot, logs, speeds)
    remembered = memory(rows)
    moving = tuple(name for i, name in enumerate(speeds) if rows.moved[:, i].any())
    theta = np.array([start.robot.parameters[name].value for name in names])
    noise = np.array([start.noise.get(name) or 1.0 for name in speeds])
    solved, found, simulated, converged, reason, passes = None, None, None, False, "", 0
    notes: list[str] = []
    for passes in range(1, _PASSES + 1):
        # Instruments need not be those of the very last digits, and what slides where depends on the estimate in steps: in
        # the end the same motion and the same intervals are used, or the passes never settle.
        same = found if passes > _CHOSEN else None
        if same is None:
            simulated = followed_simulation(with_estimate(robot, names, theta), logs)
        if simulated is None:
            reason = f"the simulation with the estimate of pass {passes - 1} diverges, so that it gives no instruments"
            break
        found = refined_instruments(with_estimate(robot, names, theta), list(logs), simulated, speeds, theta, same)
        if not len(found.targets) and solved is not None:
            simulated = None
            reason = (
                f"the instruments are weak: with the estimate of pass {passes - 1} nothing slides where the robot did"
            )
            notes.append(
                "The instruments are weak: the simulated motion has nothing to do with the measured one. The values "
                "are not to be trusted; look for missing effects or a wrong channel, or excite the robot more."
            )
            break
        if not len(found.targets):
            raise LogError(
                f"nowhere in the logs {', '.join(log.name for log in logs)} do the robot and its simulation both slide; "
                "give logs with steady motion, or use output error."
            )
        solved = _solve(found, robot, names, noise, remembered)
        noise, moved, theta = solved.noise, np.abs(solved.theta - theta), solved.theta
        error = np.nan_to_num(solved.errors)
        if np.all(moved <= np.maximum(_SETTLED * error, 1e-7 * np.abs(theta))):
            converged, reason = True, f"settled in {passes} passes"
            break
    else:
        reason = f"the estimate did not settle in {_PASSES} passes"
    if solved is None or simulated is None:
        # An estimate whose model runs away says nothing; the one it began from is at least that of a known method.
        n, found = len(names), None
        theta = np.array([start.robot.parameters[name].value for name in names])
        solved = _Solved(theta, np.full((n, n), np.nan), np.full(n, np.nan), ("not_identifiable",) * n, noise, 1.0, 0)
        reason += "; the values are those of the start"
    if found is not None and simulated is not None:
        slopes = whole_slopes(robot, logs, speeds, theta, np.sqrt(np.diag(solved.covariance)), found)
        solved = _solve(found, robot, names, noise, remembered, slopes)
        solved = replace(solved, relevance=min(solved.relevance, _followed(logs, simulated, moving)))
        notes.append(
            f"The simulated motion explains {100 * solved.relevance:.0f} % of the measured speeds and regressors or more; "
            f"{100 * found.dropped:.1f} % of the intervals were left out because something may have stood still or turned "
            "round, or was not measured."
        )
        if solved.relevance <= _WEAK:
            converged = False
            reason = f"weak instruments: the simulated motion has too little to do with the measured one ({reason})"
            notes.append(
                f"The instruments are weak, most of all for {names[solved.weakest]}. Estimates and intervals are not to be "
                "trusted; look for missing effects or a wrong channel, or excite the robot more."
            )
    notes += status_notes(names, solved.status, solved.errors)
    identified = with_estimate(robot, names, solved.theta)
    own = estimates_with(robot, names, solved.theta, solved.errors, solved.status)
    known = np.where(np.isfinite(solved.covariance), solved.covariance, 0.0)
    fit = Fit(
        method=METHOD,
        robot=identified,
        parameters=estimates_of(identified, own),
        combinations=combinations(identified, identified.parameters.numbers, names, known),
        free_names=names,
        covariance=solved.covariance,
        noise={name: float(solved.noise[i]) for i, name in enumerate(speeds)},
        converged=converged,
        reason=reason,
        iterations=passes,
        notes=tuple(notes),
    )
    if found is None:
        # What the equations leave with the values of the start says nothing about this estimate.
        of_start = judged_equations(fit, logs).judgement
        assert of_start is not None
        why = (f"{reason[0].upper()}{reason[1:]}.",)
        failed = replace(of_start, verdict="failed", white=None, sentences=why, better=_OTHERS)
        fit = replace(judged(fit, failed), reason=reason, standard_errors="robust")
    elif simulated is None:
        fit = replace(judged_equations(fit, logs), standard_errors="robust")
    else:
        fit = judged_instruments(fit, logs, _errors(found, solved.theta, speeds), simulated)
    fit = without_what_pushes_alike(with_units_doubted(fit, logs), logs, measured=True)
    return replace(fit, robot=given.with_parameters(fit.robot.parameters))
