"""In which logs the robot carried a load, where nobody wrote it down.

A load that is there in some logs and not in others is one number for the robot and one bit for every log. The bits are found
first, so that the load is then a mechanism like any other, looked for, refitted and judged beside all others. To first order a
mass (and an inertia) of each log's own is fitted beside the shared parameters; if these explain most of what is missing, the
logs fall into two groups. Refitted with the load in one of the groups, each log, held-out ones too, goes to the group that
predicts it better.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.linalg import block_diag

from .._float64 import in_float64
from ..effects.body.payload import PAYLOAD, InSomeLogs
from ..estimate.output_error.estimated_start import estimated_start
from ..estimate.result import Fit
from ..logs import Log, LogSet, noise_scale
from ..logs.windows import Windows
from ..robots.robot import Robot
from ..robots.traits import refusal
from ..simulation.simulate import integrator_for, simulate_models
from .heldout import scaled_residuals
from .refit import Trial, refit

Array = NDArray[np.float64]
_FEWEST, _MOST = 3, 60
"""Logs below which nobody can say which one is another, and beyond which columns of each one's own are too many."""
_GAP = 1.1
"""Residual of the fitted logs, in units of the noise, below which too little is missing to sort logs by."""
_SHARE = 0.5
"""Share of what is missing that loads of each log's own must explain."""
_STEP, _SINGULAR = 1e-3, 1e-6
_ROUNDS = 3


def sorted_by_payload(
    fit: Fit, logs: LogSet, held_out: LogSet, report: Callable[[str], None]
) -> tuple[LogSet, LogSet, str]:
    """The logs with a column `payload` of zeros or ones and a sentence on it, where a load in some of them explains most of
    what `fit` leaves; else the logs as they are. Logs of which any has such a column already are left alone."""
    law = InSomeLogs()
    every = [*logs, *held_out]
    if (
        not _FEWEST <= len(logs) <= _MOST
        or isinstance(logs, Windows)
        or any(effect.id == law.id for effect in fit.robot.effects)
        or refusal(law, fit.robot) is not None
        or any(PAYLOAD in log.extra for log in every)
    ):
        return logs, held_out, ""
    robot, noise = fit.robot + law, noise_scale(held_out, otherwise=logs)
    found = _heavier(robot, fit, logs, noise)
    if found is None:
        return logs, held_out, ""
    report("most of what is missing would be another load in some of the logs; looking in which")
    sides, start = found
    fitted, others = _with(logs, sides), held_out
    for _ in range(_ROUNDS):
        trial = refit(robot, [start], fitted, others, noise, fit.initial_states)
        fitted, others, changed = _better(trial, logs, noise), _better(trial, held_out, noise), fitted
        start = {name: trial.robot.parameters[name].value for name in trial.robot.parameters.free_names}
        if _bits(fitted) == _bits(changed):
            break
    if len(set(_bits(fitted))) < 2:
        return logs, held_out, ""
    return fitted, others, _said(fitted, others)


def _said(logs: LogSet, held_out: LogSet) -> str:
    loaded = [log.name for log in (*logs, *held_out) if log.extra[PAYLOAD].iloc[0] > 0]
    return (
        f"Looked for a load that is there in some of the logs: {', '.join(loaded)}. Which ones, each log itself told, the "
        f"held-out ones, too; a column `{PAYLOAD}` of ones or zeros in the files says it beforehand."
    )


def _bits(logs: LogSet) -> list[float]:
    return [float(log.extra[PAYLOAD].iloc[0]) for log in logs]


def _with(logs: LogSet, payload: list[float]) -> LogSet:
    """The logs with the column, in the place of any that they have."""
    return LogSet([replace(log, extra=_column(log, value)) for log, value in zip(logs, payload, strict=True)])


def _column(log: Log, value: float) -> pd.DataFrame:
    own = pd.DataFrame({PAYLOAD: np.full(len(log), value)})
    others = log.extra.drop(columns=PAYLOAD, errors="ignore")
    return pd.concat([others, own], axis=1) if len(others.columns) else own


@in_float64
def _better(trial: Trial, logs: LogSet, noise: dict[str, float]) -> LogSet:
    """The logs, each with or without the load, whichever predicts it better."""
    squares, steps = [], integrator_for(trial.robot, logs)
    for value in (0.0, 1.0):
        own = _with(logs, [value] * len(logs))
        start = estimated_start(trial.robot, own, noise)
        outputs = [y[0] for y in simulate_models([trial.robot], own, start=start, integrator=steps)]
        squares.append([float(np.nansum(r**2)) for r in scaled_residuals(own, outputs, noise)])
    return _with(logs, [float(b < a) for a, b in zip(*squares, strict=True)])


@in_float64
def _heavier(
    robot: Robot, fit: Fit, logs: LogSet, noise: dict[str, float]
) -> tuple[list[float], dict[str, float]] | None:
    """Which logs' own load is the larger, to first order, and the parameters to begin from; None where loads explain little."""
    loads, free, table = list(InSomeLogs().parameters(fit.robot)), list(fit.free_names), robot.parameters
    sizes = {n: max(abs(table[n].value), table[n].typical or 0.0, np.finfo(float).tiny) for n in (*free, *loads)}
    moved = [robot.with_values(**{n: table[n].value + _STEP * sizes[n]}) for n in (*free, *loads)]
    loaded = _with(logs, [1.0] * len(logs))
    start = estimated_start(robot, loaded, noise)
    by_log = simulate_models([robot, *moved], loaded, start=start, integrator=integrator_for(robot, loaded))
    here, *there = (scaled_residuals(loaded, [y[k] for y in by_log], noise) for k in range(1 + len(moved)))
    pooled = np.concatenate(here)
    rows, count = np.nan_to_num(pooled).ravel(), int(np.isfinite(pooled).sum())
    if not _GAP**2 * count < rows @ rows < np.inf:
        return None
    columns = [
        np.stack([np.nan_to_num((changed[e] - r) / _STEP).ravel() for changed in there], axis=1)
        for e, r in enumerate(here)
    ]
    every = np.concatenate(columns)
    # What all logs share of a load is the robot's own mass: of each log's own it is part.
    shared = [i for i, name in enumerate(free) if name not in robot.mechanisms[InSomeLogs.id]]
    apart = np.asarray(block_diag(*(own[:, len(free) :] for own in columns)))
    _, common, _ = _solved(every[:, : len(free)], rows)
    step, left, variances = _solved(np.concatenate([every[:, shared], apart], axis=1), rows)
    if common - left < _SHARE * max(common - count, 0.0):
        return None
    masses, *others = (slice(len(shared) + i, None, len(loads)) for i in range(len(loads)))
    heavy = _upper_of_two(step[masses], 1.0 / variances[masses])
    begin = {name: table[name].value for name in free}
    for name, own in zip(loads, (masses, *others), strict=True):
        means = [np.average(step[own][side], weights=1.0 / variances[own][side]) for side in (heavy, ~heavy)]
        begin[name] = float(means[0] - means[1]) * sizes[name]
    return [float(side) for side in heavy], begin


def _solved(columns: Array, rows: Array) -> tuple[Array, float, Array]:
    """The step that takes up most of `rows`, the sum of squares that is left, and the variances of the step."""
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0, size, 1.0)
    left, values, right = np.linalg.svd(columns / size, full_matrices=False)
    inverse = np.where(values > _SINGULAR * values[0], 1.0 / np.maximum(values, 1e-300), 0.0)
    step = -(right.T * inverse) @ (left.T @ rows) / size
    # What the rows do not tell is any value, and not zero for sure.
    scatter = np.sum((right.T / np.maximum(values, _SINGULAR * values[0])) ** 2, axis=1) / size**2
    return step, float(np.sum((rows + columns @ step) ** 2)), scatter


def _upper_of_two(values: Array, weights: Array) -> NDArray[np.bool_]:
    """Which of the values belong to the upper of two groups, split where least is left of their weighed squares."""
    order, splits = np.argsort(values), []
    for k in range(1, len(values)):
        upper = np.isin(np.arange(len(values)), order[k:])
        left = 0.0
        for group in (upper, ~upper):
            middle = np.average(values[group], weights=weights[group])
            left += float(weights[group] @ (values[group] - middle) ** 2)
        splits.append((left, upper))
    return min(splits, key=lambda own: own[0])[1]
