"""What a refit would leave of the difference between two models on experiments that are only planned."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..._arrays import array
from ..._float64 import in_float64
from ...estimate.output_error.direct import linearised_now
from ...estimate.output_error.problem import Problem
from ...estimate.output_error.setup import build
from ...logs import LogSet
from ...logs.windows import Windows
from .refit import Trial, refit


def _weighted(problem: Problem, noise: Mapping[str, float], channels: tuple[str, ...]) -> Problem:
    """The problem in units of `noise`, where that is known."""
    sigma = np.array([noise.get(name, np.nan) for name in channels])
    return replace(problem, sigma=array(np.where(np.isfinite(sigma), sigma, np.asarray(problem.sigma))))


@in_float64
def left_by_refit(trial: Trial, logs: LogSet, runs: LogSet, noise: Mapping[str, float]) -> NDArray[np.float64]:
    """RMS in units of the `noise` that `trial`, refitted to `logs` and to one of the planned `runs` (whose outputs are another
    model's), would leave of that run: one linear step, [runs]. What it costs on `logs` counts as left."""
    robot, measured = trial.robot, logs.channels.measured
    structure, problem, unknowns = build(robot, logs, start={})
    known = np.asarray(linearised_now(structure, _weighted(problem, noise, measured), unknowns).shared)
    if not np.all(np.isfinite(known)):
        known = np.zeros_like(known)
    found = np.zeros(len(runs))
    for i, run in enumerate(runs):
        structure, problem, unknowns = build(robot, LogSet([run]), start={}, initial="known")
        problem = _weighted(replace(problem, prior_precision=0 * problem.prior_precision), noise, measured)
        step = linearised_now(structure, problem, unknowns)
        rows = np.concatenate([np.asarray(step.shared), known])
        residual = np.concatenate([np.asarray(step.residual_shared), np.zeros(len(known))])
        squares = float(np.sum(np.asarray(step.rest) ** 2))
        if np.all(np.isfinite(rows)) and np.all(np.isfinite(residual)):
            size = np.linalg.norm(rows, axis=0)
            rows = rows / np.where(size > 0, size, 1.0)
            change = np.linalg.lstsq(rows, -residual, rcond=None)[0]
            left = squares + float(np.sum((rows @ change + residual) ** 2))
            found[i] = np.sqrt(left / max(np.count_nonzero(np.isfinite(run.outputs)), 1))
    return found


def left_after_refit(trial: Trial, logs: LogSet, run: LogSet, noise: Mapping[str, float]) -> float:
    """RMS in units of the `noise` that `trial` leaves of the one planned `run` once it is refitted to `logs` and to it.

    Of a model whose wheels' angles are prescribed, or which is fitted in windows, by one linear step (`left_by_refit`)."""
    if trial.angles or isinstance(logs, Windows):
        return float(left_by_refit(trial, logs, run, noise)[0])
    own = {name: trial.robot.parameters[name].value for name in trial.robot.parameters.free_names}
    again = refit(trial.robot, [own], LogSet([*logs, *run]), run, noise, trial.initial_states)
    return float(again.held_out.normalised_rms) if np.isfinite(again.squares) else np.inf
