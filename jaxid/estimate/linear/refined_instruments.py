r"""Equations whose error is the sensors' own noise, with the simulated motion's regressors as instruments.

Over one interval, measured speeds v = v_true + n give v(t_k+1) - v(t_k) - integral(dv/dt) = n_(k+1) - a_k n_k: an error
that is coloured by the robot's own dynamics a. Filtered with their inverse (x_(k+1) = a_k x_k + e_k, linearised along
the simulated motion, speed by speed), the equation's error is n itself, white when the sensors' noise is: the prefilter
of refined instrumental variables (Young, "Refined instrumental variable estimation", Automatica 52, 2015), for a robot.
What the noise of one speed does in another's equation stays, and the covariance counts it (`coupled_noise`).
The unknown n at the start of every run of intervals is eliminated. Friction takes the simulated motion's direction, and
states that were not measured are its own. What interpolation between samples gets wrong is taken off: over the simulated
motion the same integrals are off by the same, and there the balance is known to be zero.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...logs import Log
from ...robots.robot import Robot
from .coupled_noise import Coupling, coupling
from .log_rows import Rows, gather
from .regressors import axes_that_matter, evaluate, noise_of, still_at

Array = NDArray[np.float64]
_CLEAR = 2.0
"""Standard deviations of its noise that a simulated rubbing speed must be away from zero: the model is well within one of
them, so that the robot slides the same way."""
_GROWN = 1e3
"""Growth of an error along an unstable motion, after which a new run begins."""


@dataclass(frozen=True)
class Instruments:
    """K equations `regressors @ theta = targets` with errors that are sensor noise, and as many `instruments` [K, n].

    `equation` [K]: index of the measured speed; `sample` [K]: place among the samples of all logs, whose log is
    `logs` [N]; `run` [K]: number of the run that the row belongs to, and `start` [K] what one unit of noise at its
    start does here. `usable` [N, nv]: intervals that were used, `sliding`: directions of friction there,
    `defect` [N, nv]: what the integrals over the simulated motion are off by; `dropped`: share of intervals not used;
    `coupling`: what the noise of one speed does in the others' equations.
    """

    regressors: Array
    instruments: Array
    targets: Array
    equation: NDArray[np.int64]
    sample: NDArray[np.int64]
    run: NDArray[np.int64]
    logs: NDArray[np.int64]
    start: Array
    usable: NDArray[np.bool_]
    sliding: Array
    defect: Array
    dropped: float
    coupling: Coupling


def _sliding(measured: Array, simulated: Array, shares: Array, rows: Rows) -> NDArray[np.bool_]:
    """[N, nv]: every axis that matters to a speed slides one way over the interval after a sample, in both motions."""
    still = still_at(measured, rows.log)
    for number in np.unique(rows.log):
        own = rows.log == number
        for axis in range(measured.shape[1]):
            v = np.abs(simulated[own, axis])
            limit = max(_CLEAR * noise_of(measured[own, axis]), 1e-3 * float(np.quantile(v, 0.95)))
            still[own, axis] |= v <= limit
    turned = np.append(simulated[:-1] * simulated[1:] < 0, np.zeros_like(still[:1]), axis=0)
    stuck = still | np.append(still[1:], still[-1:], axis=0) | turned
    return rows.whole[:, None] & rows.moved & ~np.stack([stuck[:, m].any(axis=1) for m in axes_that_matter(shares)], 1)


def _filtered(columns: Array, growth: Array, usable: NDArray[np.bool_]) -> tuple[Array, Array, NDArray[np.int64]]:
    """x_(k+1) = growth_k x_k + columns_k [N, m] along runs of usable intervals [N]: x, what one unit at the run's start
    has become, and the run's number (-1: none)."""
    N = len(usable)
    x, unit, run = np.zeros_like(columns), np.zeros(N), np.full(N, -1)
    number, follows = -1, False
    for k in np.flatnonzero(usable[:-1]):
        follows = run[k] >= 0 and abs(unit[k]) < _GROWN
        if not follows:
            number += 1
            x[k], unit[k], run[k] = 0.0, 1.0, number
        x[k + 1] = growth[k] * x[k] + columns[k]
        unit[k + 1], run[k + 1] = growth[k] * unit[k], number
    return x, unit, run


def refined_instruments(
    robot: Robot,
    logs: list[Log],
    simulated: list[Array],
    names: tuple[str, ...],
    theta: Array,
    before: Instruments | None = None,
) -> Instruments:
    """Equations of the measured motion and instruments of the `simulated` one ([T, measured channels] by log), both
    linearised about `theta`. Intervals are used in which both motions slide, or those of `before`."""
    rows = gather(robot, logs, names)
    twins = [replace(log, outputs=outputs) for log, outputs in zip(logs, simulated, strict=True)]
    other = gather(robot, twins, names)
    own = {name: np.where(rows.moved, getattr(other, name), 0.0) for name in ("speeds", "ahead")}
    other = replace(other, **own, moved=rows.moved)
    # Where friction turns within an interval depends on the estimate in steps, which would never settle.
    known = np.array(np.nan) if before is None else before.sliding
    there = evaluate(robot, other, names, "speed", theta, known)
    _, _, impulse_there, instrument, rubbing_there, _, at_start, at_end, sliding, places = there
    # The noise of a light axis, such as a caster, turns its measured direction, and the angle that noisy speeds turn it to
    # enters with its sine: neither is linear in the noise, and no instrument puts that right.
    _, _, impulse, slope, rubbing, shares, *_ = evaluate(robot, rows, names, "speed", theta, sliding, places)
    n, nv = len(theta), len(names)
    # What interpolation and quadrature between samples get wrong they get wrong in the simulated motion as well, where it
    # is known: the balance of its own samples is zero.
    defect = other.ahead - other.speeds - impulse_there if before is None else before.defect
    error = rows.ahead - rows.speeds - impulse - defect + slope @ theta
    columns = np.concatenate([slope, instrument, error[:, :, None]], axis=2)
    first, last = (np.diagonal(s, axis1=1, axis2=2) for s in (at_start, at_end))
    # Zero where the motion runs away faster than its samples follow: no equation there.
    implicit = np.where(np.isfinite(last) & (last != 1.0), 1.0 - last, np.nan)
    columns, growth = columns / implicit[:, :, None], (1.0 + first) / implicit
    usable = _sliding(rubbing, rubbing_there, shares, rows) if before is None else before.usable
    usable = usable & np.isfinite(columns).all(axis=2) & np.isfinite(growth)

    parts, count, runs = [], 0, np.full((len(rows.dt), nv), -1)
    for i in range(nv):
        x, unit, run = _filtered(columns[:, i], growth[:, i], usable[:, i])
        runs[:, i] = run
        sample = np.flatnonzero(rows.seen[:, i] & (run >= 0))
        parts.append((x[sample], unit[sample], run[sample] + count, np.full(len(sample), i), sample))
        count += int(run.max(initial=-1)) + 1
    table, start, run, equation, sample = (np.concatenate(part) for part in zip(*parts, strict=True))
    intervals = max(int(np.sum(rows.dt > 0)), 1)
    used = usable.sum(axis=0)[rows.moved.any(axis=0)] / intervals
    return Instruments(
        regressors=table[:, :n],
        instruments=table[:, n : 2 * n],
        targets=table[:, 2 * n],
        equation=equation,
        sample=sample,
        run=run,
        logs=rows.log,
        start=start,
        usable=usable,
        sliding=sliding,
        defect=defect,
        dropped=1.0 - float(np.mean(used)) if len(used) else 1.0,
        coupling=coupling(growth, at_start / implicit[:, :, None], at_end / implicit[:, :, None], runs, rows.moved),
    )
