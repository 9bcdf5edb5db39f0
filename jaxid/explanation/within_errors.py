"""Is a held-out error no more than what the fit's own standard errors let expect?

A parameter that is off by one standard error moves a long motion by less than the noise but for many samples in a row, and
a test of whiteness finds that. Nothing is missing for it: other logs would have said another value.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from .._distributions import chi_squared_beyond
from ..estimate.output_error.estimated_start import estimated_start
from ..estimate.result import Fit
from ..logs import LogSet
from ..simulation.simulate import integrator_for, simulate_models
from .heldout import HeldOut, scaled_residuals, whiteness


def within_errors(fit: Fit, held_out: LogSet, state: HeldOut) -> HeldOut:
    """`state`, which `fit` leaves on the `held_out` logs, marked as within its errors where that is so.

    To first order: is there a change of the parameters, likely by the fit's own covariance, that leaves white noise? Only of a
    fit whose residual on its own logs is white and has no mark of anything missing.
    """
    covariance = np.asarray(fit.covariance)
    sound = fit.judgement is not None and fit.judgement.verdict == "sound" and bool(fit.judgement.white)
    if not sound or not covariance.size or not np.isfinite(covariance).all() or state.diverged:
        return state
    variances, directions = np.linalg.eigh(covariance)
    steps = (directions * np.sqrt(np.maximum(variances, 0.0))).T[variances > 0.0]  # one standard error each
    centre = np.array([fit.robot.parameters[name].value for name in fit.free_names])
    table = fit.robot.parameters
    low, high = (np.array([getattr(table[name], side) for name in fit.free_names]) for side in ("lower", "upper"))

    def robot(values):
        return fit.robot.with_values(**dict(zip(fit.free_names, np.clip(values, low, high).tolist(), strict=True)))

    others = [robot(centre + sign * step) for step in steps for sign in (1.0, -1.0)]
    start: Mapping = estimated_start(fit.robot, held_out, state.noise)
    by_log = simulate_models(
        [fit.robot, *others], held_out, start=start, integrator=integrator_for(fit.robot, held_out)
    )
    outputs = [scaled_residuals(held_out, [y[k] for y in by_log], state.noise) for k in range(1 + len(others))]
    changes = [
        np.stack([(outputs[2 * i + 1][e] - outputs[2 * i + 2][e]) / 2.0 for i in range(len(steps))], axis=-1)
        for e in range(len(held_out))
    ]
    columns = np.concatenate([np.nan_to_num(own).reshape(-1, len(steps)) for own in changes])
    residual = np.concatenate([np.nan_to_num(r).ravel() for r in state.residuals])
    moved = -np.linalg.solve(np.eye(len(steps)) + columns.T @ columns, columns.T @ residual)
    if moved @ moved > chi_squared_beyond(state.false_alarm / 2, len(steps)):
        return state
    left = tuple(r + own @ moved for r, own in zip(state.residuals, changes, strict=True))
    size = float(np.sqrt(np.nanmean(np.concatenate([r.ravel() for r in left]) ** 2)))
    there = replace(state, residuals=left, normalised_rms=size, p_white=whiteness(left))
    return replace(state, within_errors=there.adequate)
