"""Output error: the parameters whose simulation comes closest to the measurement.

All free physical parameters, and each log's initial state where it is not known, minimise the simulated-minus-measured
error over all logs at once, every channel in units of its noise, which is estimated along the way. Rollouts see the
logged inputs only; no measurement is fed back, so noise on the outputs biases nothing (Ljung 1999, section 7).
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Literal

from ..._compile import seldom_collected
from ..._float64 import in_float64
from ..._origin import with_origin
from ...logs import LogSet
from ...logs.windows import Windows as Cut
from ...robots.closed_loop import Controller, Law, closed_loop
from ...robots.given import check_choice, check_free, given_logs
from ...robots.replayed import replayed
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ..result import Fit
from ..units_doubted import with_units_doubted
from .beyond_supply import beyond_supply
from .conclude import Covariance
from .contradicting import contradicting
from .fitted import fitted
from .losses import Loss, loss_named
from .other_units import in_other_units
from .posed import Options
from .setup import InitialStates, Starts, every_start
from .solvers import DEFAULT, Solver
from .uneven_stamps import with_stamps_noted
from .unusable_readings import without_unusable_readings
from .windows import Unless, choose

Windows = float | Literal["auto"] | None
_REFINING = 60
"""Steps at most from where a fit came already."""


def _silent(message: str) -> None:
    pass


@with_origin
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
    report: Callable[[str], None] = _silent,
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
        loop, looped = closed_loop(robot, logs, controller)
        law = replayed(robot, logs, loop.controller)
        robot, logs, another = loop, looped, law.sentence if law is not None else ""
    else:
        another = ""
    logs = given_logs(robot, logs)
    check_choice("initial_states", initial_states, InitialStates)
    check_choice("covariance", covariance, Covariance)
    every_start(robot, start)  # nothing is simulated before a mistake in the start is told
    check_free(robot)
    options = Options(initial_states, integrator, loss_named(loss), solver, covariance, clock_offset, max_steps, report)
    if windows != "auto":
        found = _noted(fitted(robot, logs, options, start, windows), robot, logs, options)
        return replace(found, notes=(*found.notes, *filter(None, [another])))

    def once(window: float | None, start: Starts, unless: Unless | None = None) -> Fit:
        if window is not None:
            report(f"windows of {window:.3g} s")
        return fitted(robot, logs, options, start, window, unless)

    found = _noted(choose(robot, logs, once, start), robot, logs, options)
    found = replace(found, notes=(*found.notes, *filter(None, [another])))
    return without_unusable_readings(found, logs, lambda usable: fitted(robot, usable, options, start, None))


def _noted(found: Fit, robot: Robot, logs: LogSet, options: Options) -> Fit:
    """The fit with what is to be said of the logs' stamps, units and commands."""
    found = with_units_doubted(_with_stamps_noted(found, robot, logs, options), logs)
    quick, other = replace(options, far_starts=False, report=_silent), ""
    contradicted = contradicting(robot, logs)  # what columns say of one another is no riddle
    if not contradicted and found.judgement is not None and found.judgement.verdict == "failed":
        options.report("the model does not follow these logs; trying their columns in other units")
        other = in_other_units(found, logs, lambda others: fitted(robot, others, quick, None, None))
    said = filter(None, (other, beyond_supply(robot, logs), *contradicted))
    return replace(found, notes=(*found.notes, *said))


def _with_stamps_noted(found: Fit, robot: Robot, logs: LogSet, options: Options) -> Fit:
    return with_stamps_noted(found, logs, lambda others, start: fitted(robot, others, options, start, None))


@with_origin
@in_float64
@seldom_collected()
def refined(
    robot: Robot,
    logs: LogSet,
    start: Mapping[str, float],
    *,
    loss: Loss | str = "squares",
    covariance: Covariance = "auto",
) -> Fit:
    """`output_error` by free simulation from `start`, values to which a fit of this model to these logs came already: none
    further off are tried, whatever it leaves. Logs that were cut into windows are fitted and judged as such."""
    options = Options("auto", None, loss_named(loss), DEFAULT, covariance, False, _REFINING, _silent, far_starts=False)
    logs = given_logs(robot, logs)
    if isinstance(logs, Cut):
        return _with_stamps_noted(fitted(robot, logs.whole, options, start, logs.seconds), robot, logs.whole, options)
    return _with_stamps_noted(fitted(robot, logs, options, start, None), robot, logs, options)
