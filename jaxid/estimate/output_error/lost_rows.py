"""Inputs that changed where rows are missing.

A simulation holds every input until the next row. Where an even clock skips rows and an input is another one afterwards,
nobody knows when in between it changed: too long an old input is an error of timing that a residual need not show, since
the parameters take it up. So the moments are drawn at random among the rows that are missing, and what the outputs would
change by is turned into a change of the parameters, to first order.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...logs import Log, LogSet
from ..result import Fit
from .evaluation import sensitivities_at, simulated_with
from .neglected import without_starts
from .problem import Problem, Structure, Unknowns, residual_weights

Array = NDArray[np.float64]

_SKIPPED = 1.5
"""Interval, in units of the usual one, from which rows are missing (as in the pre-flight check)."""
_EVEN, _MOSTLY = 0.2, 0.7
"""Share of the usual interval within which others are as long, and share of all that are on an even clock."""
_DRAWS = 12
_SEED = 0


def unknown_changes(logs: LogSet) -> list[NDArray[np.int64]]:
    """Of each log, the samples after which rows are missing and an input is another one when they go on."""
    found = []
    for log in logs:
        rows = _rows_of_inputs(log)
        steps = np.diff(log.time[rows])
        skipped = steps > _SKIPPED * np.median(steps) if len(steps) else np.zeros(0, bool)
        changed = np.any(np.diff(log.inputs[rows], axis=0) != 0.0, axis=1)
        found.append(rows[1:][skipped & changed] - 1)
    return found


def _rows_of_inputs(log: Log) -> NDArray[np.int64]:
    """The rows that say what the inputs are: of tables of several clocks in one, whose rows are no even clock, those of the
    sensor beside which the inputs stand; else all."""
    changed = np.any(np.diff(log.inputs, axis=0) != 0.0, axis=1)
    near = np.abs(np.diff(log.time) / log.sampling_interval - 1.0) < _EVEN
    there = np.isfinite(log.outputs)
    for own in there.T[np.argsort(there.sum(axis=0))] if np.mean(near) < _MOSTLY else ():
        if changed.any() and own[1:][changed].all():
            return np.flatnonzero(own)
    return np.arange(len(log))


def _drawn(logs: LogSet, changes: Sequence[NDArray[np.int64]], inputs: Array, rng: np.random.Generator) -> Array:
    """Inputs [E, T, nu] whose changes come at any of the rows that are missing or at the next one there is."""
    inputs = inputs.copy()
    for e, (log, at) in enumerate(zip(logs, changes, strict=True)):
        rows = np.round((log.time[at + 1] - log.time[at]) / log.sampling_interval)
        early = np.floor(rng.uniform(size=len(at)) * rows) / rows  # share of the interval that has the new input
        inputs[e, at] += early[:, None] * (log.inputs[at + 1] - log.inputs[at])
    return inputs


def _shifts(structure: Structure, problem: Problem, unknowns: Unknowns, changes: Array) -> Array:
    """Parameters' changes [n, k], to first order, by changes of what is measured [E, T, ny, k]."""
    n, k = len(structure.names), changes.shape[-1]
    _, jacobian = (np.asarray(x) for x in sensitivities_at(structure, problem, unknowns))
    weights = residual_weights(problem)[..., None]
    moved = np.nan_to_num(np.where(weights > 0.0, changes, 0.0) * weights)
    both = np.concatenate([jacobian[..., :n], moved], axis=-1)
    both = without_starts(problem, both, jacobian[..., n:]).reshape(-1, n + k)
    free = np.asarray(problem.free)
    prior = np.diag(np.sqrt(np.asarray(problem.prior_precision)))[:, free]
    own = np.concatenate([both[:, :n][:, free], prior])
    moved = np.concatenate([both[:, n:], np.zeros((n, k))])
    size = np.maximum(np.linalg.norm(own, axis=0), np.finfo(float).tiny)
    found = np.zeros((n, k))
    if np.isfinite(own).all():
        found[free] = np.linalg.lstsq(own / size, moved, rcond=1e-12)[0] / size[:, None]
    return found


def lost_rows(fit: Fit, logs: LogSet, structure: Structure, problem: Problem, unknowns: Unknowns) -> str:
    """A sentence on how far the missing rows may have moved the parameters of `fit`; empty where no input changed across
    them, or where that is less than their standard errors. `logs` are those of the problem. Call under float64."""
    changes = unknown_changes(logs)
    count = sum(map(len, changes))
    errors = np.array([fit[name].std_error for name in structure.names])
    known = np.isfinite(errors) & (errors > 0.0)
    if not count or not known.any():
        return ""
    inputs, rng = np.asarray(problem.inputs), np.random.default_rng(_SEED)
    drawn = [_drawn(logs, changes, inputs, rng) for _ in range(_DRAWS)]
    here, *there = simulated_with([inputs, *drawn], structure, problem, unknowns)
    shifts = _shifts(structure, problem, unknowns, np.stack([y - here for y in there], axis=-1))
    off = np.where(known, np.sqrt(np.mean(shifts**2, axis=1)) / np.where(known, errors, 1.0), 0.0)
    most = int(np.argmax(off))
    if not off[most] > 1.0:
        return ""
    first = next(e for e, at in enumerate(changes) if len(at))
    log, at = logs[first], int(changes[first][0])
    return (
        f"Rows are missing and an input is another one after them, {count} time(s) (first in {log.name}, after t = "
        f"{log.time[at]:.4g} s). When it changed is not known, and {structure.names[most]} may be off for that by "
        f"{off[most]:.2g} of its standard errors, which do not include it. If inputs were held until the next row, nothing "
        "is amiss; if not, cut the logs there (`explain` estimates when they changed)."
    )
