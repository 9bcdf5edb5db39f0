"""Prediction error: maximum likelihood where the motion is disturbed as well as measured with noise.

Parameters and both noises, of process and sensors, make the filter's innovations likeliest. Where there is no process noise
this is output error; where a free simulation drifts or is unstable the filter still follows, since every prediction starts
from what has been measured so far. Sources: Ljung, System Identification, 1999, chapters 7 and 13; Kristensen, Madsen &
Jorgensen, Parameter estimation in stochastic grey-box models, Automatica 40, 2004 (CTSM).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ..._arrays import AnyArray, array
from ..._compile import seldom_collected
from ..._float64 import in_float64
from ..._origin import with_origin
from ...logs import LogError, LogSet
from ...parameters import ParameterError
from ...robots.given import check_choice, given_logs
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ..judge import judge, judged
from ..linear.integral_least_squares import linear_estimate
from ..nothing_moved import where_nothing_moved
from ..output_error.setup import InitialStates, StartValues, start_values
from ..result import Fit
from ..uncertainty import TYPICALLY, combinations, estimates, spread
from ..units_doubted import with_units_doubted
from .beside_output_error import contradiction, noise_instead
from .disturbance import SIGNIFICANT, disturbance
from .likelihood import Problem, noise_at, parameters_at, unflat
from .scoring import QUIETEST, Optimum, costs_at, look_at, minimise_in_turns
from .setup import Task, build
from .uncertainties import Whitened, doubts, expected, pseudo_inverse, sandwich, stated, whitened
from .unknown_levels import Looks, averaged

METHOD = "prediction_error"
_LEVELS = np.linspace(-10.0, 0.0, 11)
"""Logarithms of the process noise that are tried at the start, in units of its reference: from none to all."""
_NOTHING = 0.02
"""Likelihood ratio below which a noise is as good as absent and set to zero."""
_STANDS_OUT = 3.0
_DIVERGED = 1e29
_SOONER = "All noise is the sensors': output error finds the same, sooner."


def _silent(message: str) -> None:
    pass


class _Found(NamedTuple):
    """The problem (with the noises that are absent switched off) and its optimum."""

    problem: Problem
    optimum: Optimum
    iterations: int


def _candidates(robot: Robot, logs: LogSet, start: StartValues) -> list[dict[str, float]]:
    """Values of the free parameters to start from: those given, or a fit's, the linear estimate's and the model's own."""
    if start is not None and not isinstance(start, Fit):
        return [start_values(robot, start)]
    found = [] if start is None else [start_values(robot, start)]
    try:
        found.append(start_values(robot, linear_estimate(robot, logs)[0]))
    except (ParameterError, LogError):
        pass
    return [*found, start_values(robot, None)]


def _first(task: Task, candidates: Sequence[Mapping[str, float]]) -> list[Float[AnyArray, " p"]]:
    """Every candidate at the level of process noise that suits it best, the likeliest first."""
    rows = []
    lower, upper, scale = (np.asarray(edge) for edge in (task.problem.lower, task.problem.upper, task.problem.scale))
    sensor, process = np.asarray(task.start.sensor), np.shape(task.start.process)
    for values in candidates:
        z = np.clip([values[n] for n in task.names], lower, upper) / scale
        rows += [np.concatenate([z, np.full(process, level), sensor]) for level in _LEVELS]
    costs = costs_at(task.names, task.model, task.problem, np.stack(rows)).reshape(len(candidates), len(_LEVELS))
    best = np.argmin(costs, axis=1)
    order = np.argsort(costs[np.arange(len(candidates)), best])
    return [rows[c * len(_LEVELS) + best[c]] for c in order if costs[c, best[c]] < _DIVERGED]


def _minimised(task: Task, problem: Problem, x: Float[AnyArray, " p"], max_steps: int) -> Optimum:
    return minimise_in_turns(task.names, task.model, problem, x, max_steps=max_steps)


def _likeliest(task: Task, starts: Sequence[Float[AnyArray, " p"]], max_steps: int) -> Optimum:
    """The best optimum reached from the starts; further ones are tried where the first did not converge."""
    best: Optimum | None = None
    for x in starts:
        found = _minimised(task, task.problem, x, max_steps)
        if best is None or float(found.look.cost) < float(best.look.cost):
            best = found
        if bool(best.converged):
            break
    assert best is not None
    return best


def _sensors_alone(task: Task, problem: Problem, x: Float[AnyArray, " p"]) -> Float[np.ndarray, " p"]:
    """`x` with sensor noise as large as what its simulation without process noise leaves: how far off a model is without
    disturbance may be any number of times what its sensors show beside one."""
    first = len(task.names) + len(task.model.noisy)
    x = np.where(np.arange(np.size(x)) < first, np.asarray(x), 0.0)
    found = whitened(task.names, task.model, problem, x)
    there = np.asarray(problem.records.there)
    count = np.maximum(there.sum(axis=(0, 1)), 1)
    with np.errstate(all="ignore"):
        left = np.sqrt(np.sum(np.where(there, found.innovations * found.deviations, 0.0) ** 2, axis=(0, 1)) / count)
        level = np.log(left / np.asarray(problem.sensor_reference))
    return np.concatenate([x[:first], np.where(np.isfinite(level), level, 0.0)])


def _without_noise(task: Task, found: _Found, max_steps: int) -> tuple[_Found, float, dict[str, float]]:
    """The likelihood ratio of all process noise and of each velocity's own; noises that bring nothing are switched off."""
    problem, optimum, steps = found
    nv = len(task.model.noisy)
    none = replace(problem, disturbed=array(np.zeros(nv, dtype=bool)))
    still = _minimised(task, none, _sensors_alone(task, none, optimum.x), max_steps)
    steps += int(still.iterations)
    gone = float(still.look.cost) > _DIVERGED
    total = float("inf") if gone else 2.0 * (float(still.look.cost) - float(optimum.look.cost))
    if total < _NOTHING:
        return _Found(none, still, steps), 0.0, dict.fromkeys(task.model.noisy, 0.0)
    if nv == 1:
        return _Found(problem, optimum, steps), total, {task.model.noisy[0]: total}
    ratios, best = {}, optimum
    for i, name in enumerate(task.model.noisy):
        off = replace(problem, disturbed=problem.disturbed.at[i].set(False))
        other = _minimised(task, off, best.x, max_steps)
        steps += int(other.iterations)
        ratio = 2.0 * (float(other.look.cost) - float(best.look.cost))
        ratios[name] = float("inf") if float(other.look.cost) > _DIVERGED else max(ratio, 0.0)
        if ratio < _NOTHING:
            problem, best = off, other
    return _Found(problem, best, steps), total, ratios


def _parameters_covariance(
    task: Task, problem: Problem, covariance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Covariance [n, n] of the physical parameters and a whitened Jacobian [n, n] that has it, from that of all
    coordinates."""
    n, slope = len(task.names), np.asarray(problem.scale)
    physical = covariance[:n, :n] * np.outer(slope, slope)
    information = pseudo_inverse(covariance[:n, :n])
    values, vectors = np.linalg.eigh(information)
    return physical, np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T / slope


def _covariance(task: Task, found: _Found) -> NDArray[np.float64]:
    """Covariance [p, p] of all coordinates for white innovations, averaged over the process noises that the logs leave open:
    over how large they may be, too, where none shows."""
    n, nv = len(task.names), len(task.model.noisy)
    levels, x = range(n, n + nv), np.array(found.optimum.x)
    absent = np.asarray(task.problem.disturbed & ~found.problem.disturbed)
    x[n : n + nv] = np.where(absent, QUIETEST, x[n : n + nv])

    def looks(points: NDArray[np.float64]) -> Looks:
        found = [look_at(task.names, task.model, task.problem, point) for point in points]
        return Looks(*(np.stack([np.asarray(part) for part in parts]) for parts in zip(*found, strict=True)))

    information = looks(x[None]).information[0] if absent.any() else np.asarray(found.optimum.look.information)
    lower, upper = (np.asarray(edge / task.problem.scale) for edge in (task.problem.lower, task.problem.upper))
    moved = np.concatenate([(x[:n] > lower) & (x[:n] < upper), x[n:] > QUIETEST])
    return averaged(x, information, looks, levels, moved)


def _status(logs: LogSet, problem: Problem, found: Whitened) -> dict[str, str]:
    """What became of every log: one whose innovations are far larger than the others' stands out."""
    count = np.maximum(np.asarray(problem.records.there).sum(axis=(1, 2)), 1)
    rms = np.sqrt(np.sum(found.innovations**2, axis=(1, 2)) / count)
    said = {}
    for e, log in enumerate(logs):
        usual = float(np.median(np.delete(rms, e))) if len(logs) > 2 else float("inf")
        astray = rms[e] > _STANDS_OUT * usual
        said[log.name] = (
            f"stands out: its innovations are {rms[e] / usual:.3g} times the other logs'" if astray else "fitted"
        )
    return said


@with_origin
@in_float64
@seldom_collected()
def prediction_error(
    robot: Robot,
    logs: LogSet,
    *,
    start: StartValues = None,
    process_noise: Sequence[str] | None = None,
    initial_states: InitialStates = "auto",
    integrator: Integrator | None = None,
    max_steps: int = 100,
    report: Callable[[str], None] = _silent,
) -> Fit:
    """Fit all free parameters of `robot`, its process noise and its sensor noise to `logs` by maximum likelihood.

    **Arguments:**

    - `start`: values by symbol, or another `Fit`, beside which (or without which) the integral least-squares estimate and
      the robot's own numbers are looked at: the likeliest of them goes on.
    - `process_noise`: names of the states that the noise drives; by default the robot's velocities (`noisy_states`).
    - `initial_states`: "known" (at rest, or as the log says), "estimate" (uncertain for every log), or "auto":
      uncertain for logs that start in motion.
    - `integrator`: step and dry-friction law; by default true sticking with steps that suit the robot.
    - `report`: called with a sentence whenever a stage of the work is done.

    Returns a `Fit` whose `noise` is the sensors' and whose `disturbance` tells process noise from sensor noise. Standard
    errors are those of the Fisher information, averaged over levels of process noise that the logs tell only roughly
    (`unknown_levels`), or a sandwich (`uncertainties`) where tests reject the innovations; the notes say which. The fit is
    "poor" where output error's estimates of the same logs contradict it (`beside_output_error`). Sensors that
    lag or are stamped late are part of the filter (`late_sensors`). Raises `ParameterError` for unknown or no free
    parameters, unknown states, sensors that remember in any other way, and where the filter diverges at every start.
    """
    logs = given_logs(robot, logs)
    check_choice("initial_states", initial_states, InitialStates)
    candidates = _candidates(robot, logs, start)
    task = build(
        robot, logs, start=candidates[0], initial=initial_states, process_noise=process_noise, integrator=integrator
    )
    starts = _first(task, candidates)
    if not starts:
        raise ParameterError(
            f"the filter of {robot.name!r} diverges at the start values; check the logs' units and signs, or give other "
            "start values"
        )
    report("start chosen")
    optimum = _likeliest(task, starts, max_steps)
    report("parameters and noises found")
    found, ratio, ratios = _without_noise(task, _Found(task.problem, optimum, int(optimum.iterations)), max_steps)
    report("compared with no process noise")
    z = np.asarray(found.optimum.x[: len(task.names)])
    scale = np.asarray(found.problem.scale)
    at_bound = (z <= np.asarray(found.problem.lower) / scale) | (z >= np.asarray(found.problem.upper) / scale)

    names, channels = task.names, logs[0].channels.measured
    # Uncertainty with every parameter free: one that lies on its bound still widens the others' intervals.
    white = whitened(names, task.model, found.problem, found.optimum.x)
    covariance = _covariance(task, found)
    doubt = doubts(white, found.problem, channels)
    if doubt:
        covariance = sandwich(white, found.problem, np.asarray(found.optimum.look.information), covariance)
    physical, jacobian = _parameters_covariance(task, found.problem, covariance)
    theta = np.asarray(parameters_at(found.problem, found.optimum.x[: len(names)]))
    known = np.asarray(task.problem.scale)
    magnitude = np.maximum(np.abs(theta), np.where(at_bound, TYPICALLY * known, known))
    certain = spread(jacobian, np.ones(len(names), dtype=bool), magnitude)._replace(covariance=physical)

    values = dict(zip(names, theta.tolist(), strict=True))
    identified = robot.with_values(**values)
    told = disturbance(names, task.model, found.problem, found.optimum.x, covariance, ratio, ratios)
    status = _status(logs, found.problem, white)
    notes = [told.sentence, *(f"{name} {what}." for name, what in status.items() if what != "fitted")]
    if doubt:
        which = "; ".join(f"those of {channel} {what}" for channel, what in doubt.items())
        notes.append(f"Innovations are not what the model promises ({which}): standard errors are the robust ones.")
    judgement = judge(logs, expected(logs, white), stated(channels, white, found.problem))
    converged = bool(found.optimum.converged)
    noise = np.asarray(noise_at(found.problem, unflat(found.problem, found.optimum.x).sensor))
    begin = np.asarray(task.problem.records.start.mean)
    uncertain = np.asarray(task.problem.records.start.covariance)
    fit = Fit(
        method=METHOD,
        robot=identified,
        parameters=estimates(robot, values, names, certain, at_bound),
        combinations=combinations(robot, identified.parameters.numbers, names, physical),
        free_names=names,
        covariance=physical,
        noise={c: float(noise[i]) for i, c in enumerate(channels) if bool(found.problem.sensed[i])},
        converged=converged,
        reason="converged: no step makes the logs noticeably likelier"
        if converged
        else f"not converged in {max_steps} steps; start closer, free fewer parameters, or allow more steps",
        iterations=found.iterations,
        initial_states={
            log.name: dict(zip(robot.states, begin[e].tolist(), strict=True))
            for e, log in enumerate(logs)
            if not uncertain[e].any()
        },
        notes=tuple(notes),
        log_status=status,
        disturbance=told,
        standard_errors="robust" if doubt else "white",
    )
    disturbed = told.p_value <= SIGNIFICANT
    judgement = replace(judgement, better="" if disturbed or doubt else _SOONER)
    if disturbed and judgement.verdict in ("sound", "coloured"):
        said = contradiction(fit, logs, initial_states, integrator, report, white=judgement.verdict == "sound")
        judgement = replace(judgement, verdict="poor", sentences=(said, *judgement.sentences)) if said else judgement
    elif disturbed and judgement.verdict == "poor" and judgement.follows:
        said = noise_instead(fit, logs, initial_states, integrator, report)
        judgement = replace(judgement, sentences=(said,), follows={}) if said else judgement
    return with_units_doubted(judged(fit, where_nothing_moved(fit, judgement, logs)), logs)
