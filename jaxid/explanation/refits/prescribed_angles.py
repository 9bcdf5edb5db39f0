"""Fits of models whose wheels' angles are prescribed from measurements (see `smoothed_angles`), and the way from there to
free simulation."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from ..._arrays import array
from ..._float64 import in_float64
from ...estimate.output_error.conclude import conclude
from ...estimate.output_error.from_optimum import initial_states_at, on_bounds
from ...estimate.output_error.globalise import shortened
from ...estimate.output_error.optimum import Optimum
from ...estimate.output_error.output_error import output_error
from ...estimate.output_error.problem import Problem, Structure, Unknowns, parameters_at
from ...estimate.output_error.reweighted import reweighted
from ...estimate.output_error.setup import build
from ...estimate.output_error.solvers import minimise_compiled
from ...estimate.result import Fit
from ...logs import LogSet
from ...robots.robot import Robot
from ...robots.scales import Scales
from ...simulation.integrated_angles import integrated_angles
from ...simulation.reckoning import angle_rates_of
from ...simulation.scaled import scales_of
from ..left.heldout import HeldOut, held_out_state
from .errors_of_angles import with_errors_of_angles
from .smoothed_angles import WANDER, Angles, smoothed_angles, smoothed_ways

PRESCRIBED_STEPS, _HORIZON_STEPS = 10, 5
_FEW = 4
"""Steps from an optimum to the one beside it of angles that are a little others."""
_SMOOTHINGS = 10
"""Most times that the wheels' angles are smoothed anew through the model that they improved."""
_TRUSTED = 5.0
"""How much less the missing forces may wander once smoothing again brings nothing: the model has become better."""
_NO_BETTER = 0.99
"""Ratio of a cost to the one before above which smoothing again brings nothing."""
_NEAR = 1.02
"""Ratio of a free simulation's chi-squared to that with prescribed angles up to which the first counts."""
_TIMES, _SAMPLES = 2.0, 75
"""The first horizon: at least as many time constants of the robot, and as many samples."""
_LONGER, _LEAST_LONGER = 1.35, 1.02
"""By how much the horizon grows, and by how much at least before growing is given up."""
_LOST, _HOPELESS = 1.5, 5.0
"""Growth of the cost per sample at which a longer horizon has lost the way, and cost at which there is none."""
_HORIZONS = 16
"""Most horizons that are tried."""
PRESCRIBED = (
    "The wheels' angles were prescribed from measurements (smoothed from the measured speeds): with a torque ripple, which "
    "notch a wheel comes to rest in hangs on less than the noise. The intervals allow for the errors of these angles."
)


def states_from(fit_states: Mapping[str, Mapping[str, float]], logs: LogSet, structure: Any, problem: Any):
    """Start of the initial states: those of an earlier fit where they are free."""
    own = np.zeros((len(logs), len(structure.state_names)))
    for e, log in enumerate(logs):
        for i, name in enumerate(structure.state_names):
            known = fit_states.get(log.name, {}).get(name)
            if known is not None:
                own[e, i] = (known - float(problem.start[name][e])) / float(problem.state_scale[i])
    return array(np.where(np.asarray(problem.state_free), own, 0.0))


def with_prescribed_angles(problem: Problem, logs: LogSet, angles: Angles) -> Problem:
    """The problem with the wheels' angles prescribed; a channel that measures one no longer counts."""
    shown = jnp.array([name not in angles for name in logs.channels.measured])
    return replace(problem, prescribed=dict(angles), mask=problem.mask & shown)


def over_longer_and_longer(structure: Structure, problem: Problem, unknowns: Unknowns, scales: Scales) -> Unknowns:
    """Minimise over the beginning of the logs, and over more and more of them: by less where the way was lost."""
    longest = float(np.max(np.sum(np.asarray(problem.dt), axis=1)))
    seconds, longer, before = max(_TIMES * scales.time, _SAMPLES * scales.interval), _LONGER, np.inf
    for _ in range(_HORIZONS):
        if seconds >= longest or longer <= _LEAST_LONGER:
            break
        current = shortened(problem, seconds)
        optimum = minimise_compiled(structure, current, unknowns, max_steps=_HORIZON_STEPS)
        cost = float(optimum.cost) / float(np.sum(np.asarray(current.mask)))
        if before == np.inf and not cost < _HOPELESS:
            break
        if np.isfinite(cost) and cost < _LOST * before:
            unknowns, before = optimum.unknowns, max(cost, 0.5)
            seconds, longer = seconds * longer, min(longer**1.5, _LONGER)
        else:
            seconds, longer = seconds / longer * longer**0.5, longer**0.5
    return unknowns


def by_name(structure: Structure, problem: Problem, unknowns: Unknowns) -> dict[str, float]:
    """The free parameters."""
    return dict(zip(structure.names, np.asarray(parameters_at(problem, unknowns.z)).tolist(), strict=True))


def chi_squared(problem: Problem, optimum: Optimum, free: Problem) -> float:
    """Chi-squared at an optimum, counted as if all samples of `free` had been: what measures a prescribed angle is left out."""
    squares = float(np.sum(np.asarray(optimum.triangle.squares)))
    return squares * float(np.sum(np.asarray(free.mask))) / float(np.sum(np.asarray(problem.mask)))


def with_better_angles(
    robot: Robot, logs: LogSet, noise: Mapping[str, float], structure: Structure, free: Problem, unknowns: Unknowns
) -> tuple[Problem, Optimum]:
    """Angles smoothed through the model and the model refitted to them, turn by turn: the problem with them, its optimum."""
    wander, best, gained = WANDER, None, False
    for _ in range(_SMOOTHINGS):
        model = robot.with_values(**by_name(structure, free, unknowns))
        states = initial_states_at(robot, logs, structure, free, unknowns)
        problem = with_prescribed_angles(free, logs, smoothed_angles(model, logs, noise, states, wander))
        optimum = minimise_compiled(structure, problem, unknowns, max_steps=PRESCRIBED_STEPS)
        better = best is None or bool(optimum.cost < _NO_BETTER * best[1].cost)
        if best is None or bool(optimum.cost < best[1].cost):
            best, unknowns = (problem, optimum), optimum.unknowns
        if not (better or gained):
            break
        wander, gained = (wander, True) if better else (wander / _TRUSTED, False)
    assert best is not None
    return best


def followed_up(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float],
    structure: Structure,
    free: Problem,
    unknowns: Unknowns,
    max_steps: int,
    *,
    horizons: bool = True,
) -> tuple[Problem, Optimum]:
    """From `unknowns` found with prescribed angles to a free simulation: the problem `free` and its optimum; where that cannot
    be had, with short `horizons` neither, the problem with better angles and its optimum."""
    problem, best = with_better_angles(robot, logs, noise, structure, free, unknowns)
    enough = _NEAR * chi_squared(problem, best, free)
    freely = minimise_compiled(structure, free, best.unknowns, max_steps=max_steps)
    if horizons and not chi_squared(free, freely, free) < enough:
        later = over_longer_and_longer(structure, free, best.unknowns, scales_of(robot, logs))
        freely = minimise_compiled(structure, free, later, max_steps=max_steps)
    if chi_squared(free, freely, free) < enough:
        return free, freely
    # A free simulation that lost its way may have come nearer to the right period.
    other = with_better_angles(robot, logs, noise, structure, free, freely.unknowns)
    return min(other, (problem, best), key=lambda own: _with_strain(robot, logs, noise, *own))


def _with_strain(robot: Robot, logs: LogSet, noise: Mapping[str, float], problem: Problem, optimum: Optimum) -> float:
    """The cost, with what the prescribed ways are off those that the measured speeds add up to: angles bend to the model that
    they are smoothed through, at a period, too, that makes a cycle more or less of a long way than there are."""
    measured, strain = integrated_angles(robot, logs), 0.0
    shares = dict(zip(robot.angles, angle_rates_of(robot), strict=True)) if measured else {}
    sigma = np.array([noise[name] for name in robot.channels.outputs]) if measured else np.zeros(0)
    for name in measured:
        rate = float(np.linalg.norm(shares[name] * sigma))
        for e, log in enumerate(logs):
            last, error = len(log) - 1, rate * float(np.linalg.norm(np.diff(log.time)))
            ways = [float(own[name][e, last] - own[name][e, 0]) for own in (problem.prescribed, measured)]
            strain += 0.5 * ((ways[0] - ways[1]) / error) ** 2 if error > 0.0 else 0.0
    return float(np.nan_to_num(optimum.cost, nan=np.inf)) + strain


def predicted(robot: Robot, held_out: LogSet, noise: Mapping[str, float]) -> HeldOut:
    """The held-out state of `robot`: with its wheels' angles prescribed if an effect repeats with them and a free simulation
    of these logs loses its way."""
    free = held_out_state(robot, held_out, noise)
    if free.adequate or not robot.needs("wheel_angles"):
        return free
    prescribed = held_out_state(robot, held_out, noise, smoothed_angles(robot, held_out, noise, {}))
    return replace(prescribed, simulated_freely=free) if free.squares > _NEAR * prescribed.squares else free


@in_float64
def fit_with_prescribed_angles(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float],
    start: Mapping[str, float],
    initial_states: Mapping[str, Mapping[str, float]],
    *,
    max_steps: int = 60,
) -> Fit:
    """The output-error fit from `start` of a model whose wheels' angles are prescribed; simulated freely if that does now.

    A note of the fit says if the angles were prescribed: the intervals then allow for their errors (`errors_of_angles`).
    """
    structure, free, unknowns = build(robot, logs, start=start)
    unknowns = unknowns._replace(states=states_from(initial_states, logs, structure, free))
    problem, best = followed_up(robot, logs, noise, structure, free, unknowns, max_steps)
    if problem is free:
        return output_error(
            robot, logs, start=by_name(structure, free, best.unknowns), windows=None, max_steps=max_steps
        )
    problem, optimum, iterations = reweighted(structure, problem, best, max_steps)
    bounded = on_bounds(structure, problem, optimum, max_steps)
    fit = conclude(robot, logs, structure, problem, optimum, bounded, iterations=iterations, max_steps=max_steps)
    values = by_name(structure, problem, optimum.unknowns)
    ways = smoothed_ways(robot.with_values(**values), logs, noise, fit.initial_states)

    def refitted(angles: Angles) -> list[float]:
        others = with_prescribed_angles(problem, logs, angles)
        found = by_name(
            structure, others, minimise_compiled(structure, others, optimum.unknowns, max_steps=_FEW).unknowns
        )
        return [found[name] for name in fit.free_names]

    fit = with_errors_of_angles(fit, ways, np.asarray([values[name] for name in fit.free_names]), refitted)
    return replace(fit, notes=(*fit.notes, PRESCRIBED))
