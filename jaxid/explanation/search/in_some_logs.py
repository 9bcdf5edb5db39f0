"""In which logs the robot had another load, battery or floor, where nobody wrote it down.

What is there in some logs and not in others is a few numbers for the robot and one bit for every log. The bits are found first,
so that it is then a law like any other, looked for, refitted and judged beside all others. To first order each log is given a
load (or battery, or floor) of its own beside the shared parameters; if these explain most of what is missing, the logs fall
into two groups. Refitted with it in one of the groups, each log, held-out ones too, goes to the group that predicts it better.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float
from numpy.typing import NDArray
from scipy.linalg import block_diag

from ..._float64 import in_float64
from ...effects.actuator.battery_sag import OtherBattery
from ...effects.body.payload import LoadInSomeLogs
from ...effects.ground.surface_change import OtherFloor
from ...effects.in_some_logs import InSomeLogs
from ...estimate.output_error.estimated_start import estimated_start
from ...estimate.result import Fit
from ...logs import Log, LogSet, noise_scale
from ...logs.windows import Windows
from ...robots.robot import Robot
from ...robots.traits import refusal
from ...simulation.simulate import integrator_for, simulate_models
from ..left.heldout import scaled_residuals
from ..refits.refit import Trial, refit

Array = NDArray[np.float64]
LAWS: tuple[InSomeLogs, ...] = (LoadInSomeLogs(), OtherBattery(), OtherFloor())
"""What may be there in some of the logs."""
_FEWEST, _MOST = 3, 60
"""Logs below which nobody can say which one is another, and beyond which columns of each one's own are too many."""
_GAP = 1.04
"""Residual of the fitted logs, in units of the noise, below which too little is missing to sort logs by."""
_SHARE = 0.5
"""Share of what is missing that changes of each log's own must explain."""
_STEP, _SINGULAR = 1e-3, 1e-6
_ABSORBED = 0.01
"""Share of a change of all logs that is left of it where the free parameters do the same."""
_ALIKE = 0.1
"""Share by which one of two groups is farther from the model as it is than the other."""
_ROUNDS = 3


@dataclass(frozen=True)
class _Sides:
    """By which law, to first order, which of the logs are others, and the parameters to begin from."""

    law: InSomeLogs
    bits: list[float]
    start: dict[str, float]


def sorted_logs(fit: Fit, logs: LogSet, held_out: LogSet, report: Callable[[str], None]) -> tuple[LogSet, LogSet, bool]:
    """The logs with columns of zeros or ones for `LAWS`, and whether they got them: where one of these in some of the logs
    explains most of what `fit` leaves. Where files have any of the columns, all is left to them."""
    present, every = {effect.id for effect in fit.robot.effects}, [*logs, *held_out]
    laws = [law for law in LAWS if law.id not in present and refusal(law, fit.robot) is None]
    told = any(law.column in log.extra for law in LAWS for log in every)
    if not laws or told or isinstance(logs, Windows) or not _FEWEST <= len(logs) <= _MOST:
        return logs, held_out, False
    if fit.judgement is not None and fit.judgement.normalised_rms < _GAP:
        return logs, held_out, False
    noise = noise_scale(held_out, otherwise=logs)
    found = _first_order(fit, laws, logs, noise)
    if found is None:
        return logs, held_out, False
    report(f"most of what is missing would be another {_thing(found.law)} in some of the logs; looking in which")
    robot, start, names = fit.robot + found.law, found.start, [law.column for law in laws]
    fitted, others = _with(logs, names, found.bits), held_out
    for _ in range(_ROUNDS):
        before = _bits(fitted, names)
        trial = refit(robot, [start], fitted, others, noise, fit.initial_states)
        fitted, others = (_better(trial, each, names, noise) for each in (logs, held_out))
        start = {name: trial.robot.parameters[name].value for name in trial.robot.parameters.free_names}
        if _bits(fitted, names) == before:
            break
    if len(set(_bits(fitted, names))) < 2:
        return logs, held_out, False
    return fitted, others, True


def _thing(law: InSomeLogs) -> str:
    return law.column.removeprefix("other_")


def unsorted(logs: LogSet) -> LogSet:
    """The logs without the columns that `sorted_logs` gave them."""
    names = [law.column for law in LAWS]
    return LogSet([replace(log, extra=log.extra.drop(columns=names, errors="ignore")) for log in logs])


def in_some_of(law: InSomeLogs, logs: LogSet, held_out: LogSet, doubted: bool = False) -> str:
    """In which logs it was that the law is about, which nobody had written down, and whether the fit with it is `doubted`."""
    others = [log.name for log in (*logs, *held_out) if log.extra[law.column].iloc[0] > 0]
    else_ = (
        " Since the fit with it is itself to be doubted, it may be something else that these logs alone have, such as another "
        "gain of a sensor; `jaxid change` between them and the others looks for that."
    )
    return (
        f"The {_thing(law)} of {', '.join(others)} is another than that of the other logs. Which ones these are, each log "
        f"itself told, the held-out ones, too; a column `{law.column}` of ones and zeros in the files says it beforehand."
        f"{else_ if doubted else ''}"
    )


def _bits(logs: LogSet, names: Sequence[str]) -> list[float]:
    return [float(log.extra[names[0]].iloc[0]) for log in logs]


def _with(logs: LogSet, names: Sequence[str], bits: Sequence[float]) -> LogSet:
    """The logs with the columns, in the place of any that they have."""
    return LogSet([replace(log, extra=_columns(log, names, bit)) for log, bit in zip(logs, bits, strict=True)])


def _columns(log: Log, names: Sequence[str], bit: float) -> pd.DataFrame:
    own = pd.DataFrame({name: np.full(len(log), bit) for name in names})
    others = log.extra.drop(columns=list(names), errors="ignore")
    return pd.concat([others, own], axis=1) if len(others.columns) else own


@in_float64
def _better(trial: Trial, logs: LogSet, names: Sequence[str], noise: dict[str, float]) -> LogSet:
    """The logs, each of either kind, whichever predicts it better."""
    squares, steps = [], integrator_for(trial.robot, logs)
    for bit in (0.0, 1.0):
        own = _with(logs, names, [bit] * len(logs))
        start = estimated_start(trial.robot, own, noise)
        outputs = [y[0] for y in simulate_models([trial.robot], own, start=start, integrator=steps)]
        squares.append([float(np.nansum(r**2)) for r in scaled_residuals(own, outputs, noise)])
    return _with(logs, names, [float(other < same) for same, other in zip(*squares, strict=True)])


@in_float64
def _first_order(fit: Fit, laws: Sequence[InSomeLogs], logs: LogSet, noise: dict[str, float]) -> _Sides | None:
    """The law that explains most with strengths of every log's own, to first order; None where they explain little."""
    robot: Robot = fit.robot
    for law in laws:
        robot = robot + law
    table, free = robot.parameters, list(fit.free_names)
    strengths = {law: list(law.parameters(fit.robot)) for law in laws}
    names = [*free, *(name for law in laws for name in strengths[law])]
    sizes = {n: max(abs(table[n].value), table[n].typical or 0.0, np.finfo(float).tiny) for n in names}
    moved = [robot.with_values(**{n: table[n].value + _STEP * sizes[n]}) for n in names]
    there = _with(logs, [law.column for law in laws], [1.0] * len(logs))
    start, steps = estimated_start(robot, there, noise), integrator_for(robot, there)
    by_log = simulate_models([robot, *moved], there, start=start, integrator=steps)
    here, *changed = (scaled_residuals(there, [y[k] for y in by_log], noise) for k in range(1 + len(moved)))
    pooled = np.concatenate(here)
    rows, count = np.nan_to_num(pooled).ravel(), int(np.isfinite(pooled).sum())
    if not _GAP**2 * count < rows @ rows < np.inf:
        return None
    triangles = [_triangle([(own[e] - r) / _STEP for own in changed] + [r]) for e, r in enumerate(here)]
    columns, rows = [own[:, :-1] for own in triangles], np.concatenate([own[:, -1] for own in triangles])
    shared = np.concatenate(columns)[:, : len(free)]
    common = _solved(shared, rows)[1]
    least, found = common - _SHARE * max(common - count, 0.0), None
    at = len(free)
    for law in laws:
        own = [block[:, at : at + len(strengths[law])] for block in columns]
        at += len(strengths[law])
        steps_, left, covariance = _each_its_own(shared, own, rows)
        if left < least and np.isfinite(steps_).all():
            other = _two_groups(steps_, covariance)
            means = [_middle(steps_[side], covariance[side]) for side in (other, ~other)]
            # The model as it is has none. Where it is as far from both, they are a matter of words, and more is the other.
            near, far = sorted(float(np.linalg.norm(mean)) for mean in means)
            rather = means[1][0] > means[0][0] if far < (1.0 + _ALIKE) * near else np.linalg.norm(means[1]) == far
            if rather:
                other, means = ~other, means[::-1]
            begin = {name: table[name].value for name in free}
            begin |= {n: float(m) * sizes[n] for n, m in zip(strengths[law], means[0] - means[1], strict=True)}
            least, found = left, _Sides(law, [float(side) for side in other], begin)
    return found


def _triangle(columns: Sequence[Float[np.ndarray, "T ny"]]) -> Float[np.ndarray, "n n"]:
    """The triangle of a log's columns, which says as much as they do, whatever the log's length."""
    return np.asarray(np.linalg.qr(np.stack([np.nan_to_num(own).ravel() for own in columns], axis=1), mode="r"))


def _each_its_own(
    shared: Array, own: Sequence[Array], rows: Array
) -> tuple[Float[np.ndarray, "E k"], float, Float[np.ndarray, "E k k"]]:
    """The strengths of every log's own beside the shared parameters, the squares left, and the strengths' covariances."""
    logs, k, n = len(own), own[0].shape[1], shared.shape[1]
    whole = np.concatenate(own)
    columns = np.concatenate([shared, np.asarray(block_diag(*own))], axis=1)
    for i in range(k):
        # What all logs have is the free parameters' where these do the same: of each log's own is then what it differs by.
        size = float(np.linalg.norm(whole[:, i]))
        if size > 0 and np.sqrt(_solved(shared, whole[:, i])[1]) < _ABSORBED * size:
            none = np.zeros((1, n + logs * k))
            none[0, n + i :: k] = size / _ABSORBED
            columns, rows = np.concatenate([columns, none]), np.append(rows, 0.0)
    step, left, covariance = _solved(columns, rows)
    places = [slice(n + e * k, n + (e + 1) * k) for e in range(logs)]
    return np.stack([step[p] for p in places]), left, np.stack([covariance[p, p] for p in places])


def _solved(columns: Array, rows: Array) -> tuple[Array, float, Array]:
    """The step that takes up most of `rows`, the sum of squares that is left, and the step's covariance."""
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0, size, 1.0)
    left, values, right = np.linalg.svd(columns / size, full_matrices=False)
    least = _SINGULAR * max(float(values[0]), 1e-100)
    inverse = np.where(values > least, 1.0 / np.maximum(values, least), 0.0)
    step = -(right.T * inverse) @ (left.T @ rows) / size
    # What the rows do not tell is any value, and not zero for sure.
    spread = right.T / np.maximum(values, least) / size[:, None]
    return step, float(np.sum((rows + columns @ step) ** 2)), spread @ spread.T


def _middle(steps: Float[np.ndarray, "E k"], covariance: Float[np.ndarray, "E k k"]) -> Float[np.ndarray, " k"]:
    """The mean of steps that are known with errors."""
    weights = np.linalg.inv(covariance)
    return np.linalg.solve(weights.sum(0), np.einsum("eij,ej->i", weights, steps))


def _two_groups(steps: Float[np.ndarray, "E k"], covariance: Float[np.ndarray, "E k k"]) -> Bool[np.ndarray, " E"]:
    """Which of the logs belong to the upper of two groups, split across the direction in which they scatter most beyond their
    errors, where least is left."""
    weights = np.linalg.inv(covariance)
    root = np.linalg.cholesky(weights.mean(0))
    away = (steps - _middle(steps, covariance)) @ root
    trust = np.linalg.det(weights) ** (1.0 / steps.shape[1])
    direction = np.linalg.eigh(np.einsum("e,ei,ej->ij", trust, away, away))[1][:, -1]
    order, splits = np.argsort(away @ direction), []
    for k in range(1, len(order)):
        upper = np.isin(np.arange(len(order)), order[k:])
        left = 0.0
        for group in (upper, ~upper):
            off = steps[group] - _middle(steps[group], covariance[group])
            left += float(np.einsum("ei,eij,ej->", off, weights[group], off))
        splits.append((left, upper))
    return min(splits, key=lambda own: own[0])[1]
