"""Is a held-out error no more than what the fit's own standard errors let expect?

A parameter that is off by one standard error moves a long motion by less than the noise but for many samples in a row, and
a test of whiteness finds that. And where a robot at rest is about to break away, as little decides whether it does, and all
that follows. Nothing is missing for either: other logs would have said other values.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..._arrays import array
from ..._distributions import chi_squared_beyond
from ...estimate.confidence.agreement import rms
from ...estimate.output_error.estimated_start import estimated_start
from ...estimate.result import Fit
from ...logs import LogSet
from ...robots.robot import Robot
from ...simulation.simulate import integrator_for, simulate_models
from ..policy import current_policy
from ..refits.smoothed_angles import smoothed_angles
from .heldout import HeldOut, scaled_residuals, whiteness

_DRAWS = 60
_IMPRECISE = 3.0
"""Standard errors that count as one where the model's law is only near the right one."""
_SEED = 43
_TURNS = 3
"""Most times that the likeliest change is looked for to first order, each time from where the last one led."""
_ANOTHER = 10.0
"""Times the noise by which a simulation is another motion, and not the same one a little off."""

Values = NDArray[np.float64]


def within_errors(fit: Fit, held_out: LogSet, state: HeldOut) -> HeldOut:
    """`state`, which `fit` leaves on the `held_out` logs, marked as within its errors where that is so.

    Is there a change of the parameters, likely by the fit's own covariance, with which the simulation leaves white noise? One
    for all logs, found to first order; else one of its own for each log of which draws of the parameters foretell another
    motion (`hung_on_it` names these). Only of a fit whose residual on its own logs is white and has no mark of anything
    missing.
    """
    covariance = np.asarray(fit.covariance)
    sound = fit.judgement is not None and fit.judgement.verdict == "sound" and bool(fit.judgement.white)
    if not sound or not covariance.size or not np.isfinite(covariance).all() or state.diverged:
        return state
    near = _Near(fit, held_out, state)
    every = list(range(len(held_out)))
    here = near.residuals([near.nowhere], every)[0]
    there = near.nearest(near.nowhere, here, every)
    if there is None or not _left(state, there).adequate:
        there = _one_by_one(near, here)
    if there is None or not _left(state, there).adequate:
        return state
    return replace(state, within_errors=True, **_hung(held_out, here, there))


def hanging(fit: Fit, held_out: LogSet, state: HeldOut) -> HeldOut:
    """`state`, which a model that something was added to leaves, with the logs whose whole motion hangs on less than its
    errors.

    Of a law near the right one the standard errors say too little: they count `_IMPRECISE` times here. Near it is one that
    follows the logs to which it was fitted. What is left of the other logs is no matter; nothing is adequate for it.
    """
    policy, covariance = current_policy(), np.asarray(fit.covariance)
    told = covariance.size and np.isfinite(covariance).all() and state.simulated_freely is None
    near_it = fit.judgement is not None and fit.judgement.normalised_rms < policy.coarse_curve
    if state.adequate or state.diverged or not (told and near_it) or not state.normalised_rms > policy.coarse_law:
        return state
    near = _Near(replace(fit, covariance=covariance * _IMPRECISE**2), held_out, state)
    here = near.residuals([near.nowhere], range(len(held_out)))[0]
    found = _other_motions(near, here)
    return (
        replace(state, **_hung(held_out, here, [found.get(e, own) for e, own in enumerate(here)])) if found else state
    )


def _hung(held_out: LogSet, here: Sequence[Values], there: Sequence[Values]) -> dict:
    """The logs on which `there` is of another motion than `here`, and what is left where they are as there."""
    hung = [log.name for log, own, other in zip(held_out, here, there, strict=True) if _another(own, other)]
    return {"hung_on_it": tuple(hung), "steady_rms": rms(np.concatenate(list(there)))}


class _Near:
    """Simulations of the held-out logs by models near a fitted one, in standard errors along its covariance's directions."""

    def __init__(self, fit: Fit, held_out: LogSet, state: HeldOut):
        variances, directions = np.linalg.eigh(np.asarray(fit.covariance))
        self._steps = (directions * np.sqrt(np.maximum(variances, 0.0))).T[variances > 0.0]  # one standard error each
        self._fit, self._logs, self._noise = fit, held_out, state.noise
        self._start: Mapping = estimated_start(fit.robot, held_out, state.noise)
        freely = state.simulated_freely is None
        self._angles = {} if freely else smoothed_angles(fit.robot, held_out, state.noise, {})
        self.nowhere = np.zeros(len(self._steps))
        self.bound = float(chi_squared_beyond(state.false_alarm / 2, len(self._steps)))

    def _robot(self, away: Values) -> Robot:
        fit, table = self._fit, self._fit.robot.parameters
        values = np.array([table[name].value for name in fit.free_names]) + away @ self._steps
        low, high = (np.array([getattr(table[name], side) for name in fit.free_names]) for side in ("lower", "upper"))
        return fit.robot.with_values(**dict(zip(fit.free_names, np.clip(values, low, high).tolist(), strict=True)))

    def residuals(self, aways: Sequence[Values], which: Sequence[int]) -> list[list[Values]]:
        """Of each model so far `away`, on each of the logs [T, channels]."""
        logs = LogSet([self._logs[e] for e in which])
        start = {name: np.asarray(own)[list(which)] for name, own in self._start.items()}
        angles = {name: array(np.asarray(own)[list(which)]) for name, own in self._angles.items()}
        by_log = simulate_models(
            [self._robot(away) for away in aways],
            logs,
            start=start,
            integrator=integrator_for(self._fit.robot, self._logs),
            prescribed=angles,
        )
        return [scaled_residuals(logs, [y[k] for y in by_log], self._noise) for k in range(len(aways))]

    def nearest(self, away: Values, residuals: Sequence[Values], which: Sequence[int]) -> list[Values] | None:
        """The residuals with the change of the parameters that is the likeliest by noise and errors, to first order again and
        again from those so far `away`, which leave `residuals`; None where it is beyond the errors."""
        found, least = None, np.inf
        for _ in range(_TURNS):
            away = self._nearer(away, residuals, which)
            if away @ away > self.bound:
                break
            residuals = self.residuals([away], which)[0]
            cost = _squares(_column(residuals)) + away @ away
            if not cost < least:
                break
            found, least = residuals, cost
        return found

    def _nearer(self, away: Values, residuals: Sequence[Values], which: Sequence[int]) -> Values:
        units = np.eye(len(away))
        both = self.residuals([away + sign * unit for unit in units for sign in (1.0, -1.0)], which)
        slopes = [(up - down) / 2.0 for up, down in zip(map(_column, both[::2]), map(_column, both[1::2]), strict=True)]
        columns = np.stack(slopes, axis=1)
        return away - np.linalg.solve(units + columns.T @ columns, columns.T @ _column(residuals) + away)

    def draws(self) -> list[Values]:
        """Parameters as likely as those of other logs, none of them beyond the errors."""
        drawn = np.random.default_rng(_SEED).normal(size=(_DRAWS, len(self._steps)))
        return list(drawn * np.sqrt(np.minimum(1.0, self.bound / np.sum(drawn**2, axis=1)))[:, None])


def _column(residuals: Sequence[Values]) -> Values:
    return np.concatenate([np.nan_to_num(own).ravel() for own in residuals])


def _squares(residual: Values) -> float:
    return float(np.nansum(residual**2))


def _another(one: Values, other: Values) -> bool:
    """Whether two residuals of one log are of two motions."""
    apart = np.abs(one - other)
    return bool(np.any(apart[np.isfinite(apart)] > _ANOTHER))


def _left(state: HeldOut, residuals: Sequence[Values]) -> HeldOut:
    size = rms(np.concatenate(list(residuals)))
    return replace(state, residuals=tuple(residuals), normalised_rms=size, p_white=whiteness(residuals))


def _one_by_one(near: _Near, here: Sequence[Values]) -> list[Values] | None:
    """The residuals with a change of its own for each log of which some draw foretells a likelier and another motion, and one
    for all others; None where there is no such log or that change is beyond the errors."""
    found = _other_motions(near, here)
    others = [e for e in range(len(here)) if e not in found]
    if not found:
        return None
    rest = near.nearest(near.nowhere, [here[e] for e in others], others) if others else []
    return None if rest is None else [found[e] if e in found else rest[others.index(e)] for e in range(len(here))]


def _other_motions(near: _Near, here: Sequence[Values]) -> dict[int, Values]:
    """The residuals, by log, with a change of its own for each of which some draw foretells a likelier and another motion."""
    draws = near.draws()
    drawn = near.residuals(draws, range(len(here)))
    found: dict[int, Values] = {}
    for e, own in enumerate(here):
        best = int(np.argmin([_squares(drawn[k][e]) + draws[k] @ draws[k] for k in range(len(draws))]))
        if _another(own, drawn[best][e]) and _squares(drawn[best][e]) < _squares(own):
            closer = near.nearest(draws[best], [drawn[best][e]], [e])
            found[e] = min([drawn[best][e], *(closer or [])], key=_squares)
    return found
