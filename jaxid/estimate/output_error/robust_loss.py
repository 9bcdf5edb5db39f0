"""Robust losses: samples far off pull with less weight than their square.

M-estimation by iteratively reweighted least squares (Holland & Welsch, Communications in Statistics 6, 1977). `u` is a
residual in units of its channel's scale, the median absolute deviation; the weights are those of a loss (`losses`).
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray

from ...logs import LogSet
from ..result import Outlier
from .evaluation import simulated
from .losses import Loss
from .optimum import Optimum
from .problem import Problem, Structure
from .solvers import DEFAULT, Solver, minimise_compiled

_NORMAL_MAD = 1.482602218505602
_ROUNDS = 40
_SETTLED = 0.02
"""A round that moves no parameter by more than this many standard errors is the last."""
_FAR_OFF = 4.5
"""Robust standard deviations beyond which a sample is listed: one normal sample in 150 000 is."""


class Robust(NamedTuple):
    """A robust optimum.

    - `problem`, `optimum`: the weighted problem and where it stopped; `inner`: the linearisation there without weights, in
      units of the noise that gives the estimates' asymptotic covariance (Huber, Robust Statistics, 1981, section 7.6).
    - `scale` [ny]: the channels' robust standard deviations; `bread`: factor that turns the information of the weighted
      problem into the expected one.
    """

    problem: Problem
    optimum: Optimum
    inner: Optimum
    scale: NDArray[np.float64]
    bread: float
    iterations: int
    outliers: tuple[Outlier, ...]


def _scales(residual: NDArray[np.float64], mask: Bool[NDArray, "E T ny"], floor: Float[NDArray, " ny"]):
    """Robust standard deviation of every channel [ny]: of samples off by more than its `floor`, which says nothing of those
    at which a coarse sensor and the model both stand still."""
    found = np.array(floor)
    for y in range(residual.shape[-1]):
        own = residual[..., y][mask[..., y] & (np.abs(residual[..., y]) > floor[y])]
        if own.size:
            found[y] = max(_NORMAL_MAD * float(np.median(np.abs(own))), floor[y])
    return found


def list_outliers(logs: LogSet, u: Float[NDArray, "E T ny"], mask: Bool[NDArray, "E T ny"]) -> tuple[Outlier, ...]:
    """Stretches of samples further than 4.5 scales from the simulation, at most one sample apart."""
    found = []
    for e, log in enumerate(logs):
        for y, channel in enumerate(log.channels.measured):
            far = np.flatnonzero((np.abs(u[e, :, y]) > _FAR_OFF) & mask[e, :, y])
            for run in np.split(far, np.flatnonzero(np.diff(far) > 2) + 1):
                if run.size:
                    worst = float(u[e, run[np.argmax(np.abs(u[e, run, y]))], y])
                    start, stop = float(log.time[run[0]]), float(log.time[run[-1]])
                    found.append(Outlier(log.name, channel, start, stop, int(run.size), -worst))
    return tuple(found)


def minimise_robustly(
    structure: Structure,
    problem: Problem,
    optimum: Optimum,
    logs: LogSet,
    loss: Loss,
    *,
    max_steps: int,
    solver: Solver = DEFAULT,
    report: Callable[[str], None],
) -> Robust:
    """Go on from the least-squares `optimum` with a robust loss. `problem.weight` must be there (ones)."""
    mask = np.asarray(problem.mask)
    measured, floor = np.asarray(problem.outputs), np.asarray(problem.sigma) * 1e-3
    total = 0
    u, scale, efficient = measured, floor, floor
    for number in range(_ROUNDS):
        residual = np.asarray(simulated(structure, problem, optimum.unknowns)) - measured
        scale = _scales(residual, mask, floor)
        u = residual / scale
        squares, slope = loss.weight(u) ** 2 * u**2, loss.slope(u)
        mean_square, mean_slope = (
            np.array([np.mean(x[..., y][mask[..., y]]) if mask[..., y].any() else 1.0 for y in range(mask.shape[-1])])
            for x in (squares, slope)
        )
        mean_slope = np.maximum(mean_slope, 1e-3)
        # With these units the scores' covariance is the expected curvature, channel by channel.
        sigma = scale * np.sqrt(mean_square / mean_slope)
        efficient = scale * np.sqrt(mean_square) / mean_slope
        weight = np.where(mask, np.sqrt(loss.weight(u)), 1.0)
        problem = replace(problem, sigma=np.asarray(sigma), weight=np.asarray(weight))
        before = optimum
        optimum = minimise_compiled(structure, problem, before.unknowns, max_steps=max_steps, solver=solver)
        total += int(optimum.iterations)
        step = np.asarray(optimum.triangle.shared) @ np.asarray(optimum.unknowns.z - before.unknowns.z)
        if number and float(np.max(np.abs(step))) < _SETTLED:
            break
    plain = replace(problem, sigma=np.asarray(efficient), weight=np.ones(mask.shape))
    inner = minimise_compiled(structure, plain, optimum.unknowns, max_steps=0)
    w = np.where(mask, np.asarray(problem.weight) ** 2, 0.0).sum() / max(mask.sum(), 1)
    bread = float(w / max(np.where(mask, loss.slope(u), 0.0).sum() / max(mask.sum(), 1), 1e-3))
    outliers = list_outliers(logs, u, mask)
    report(f"{type(loss).__name__} loss: {sum(o.samples for o in outliers)} samples far off")
    return Robust(problem, optimum, inner, scale, bread, total, outliers)
