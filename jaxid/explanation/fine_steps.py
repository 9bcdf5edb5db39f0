"""Integration steps for a model that has become better: what an incomplete model's residual hides of their error, the noise
does not."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..logs import LogSet
from ..simulation.rollout import Integrator
from ..simulation.simulate import integrator_for, simulate
from .refit import Trial, refit_from_itself

_FINER, _MOST = 4, 3
"""By how much steps are shortened at a time, and how often at most."""
_VISIBLE = 0.1
"""Difference that shorter steps make to the fitted logs, RMS in units of the noise, from which steps are too long."""
_CLOSE = 20.0
"""Residual in units of the noise above which no integration error is worth looking at."""


def _needs(trial: Trial, logs: LogSet, noise: Mapping[str, float]) -> float | None:
    """The integration step [s] that the model needs on these logs; None where its own is short enough."""
    own = integrator_for(trial.robot, logs)
    counts = [name in trial.fitted.noise for name in logs.channels.measured]
    level = np.array([noise[name] for name, ok in zip(logs.channels.measured, counts, strict=True) if ok])
    coarse, found = simulate(trial.robot, logs, integrator=own), own
    for _ in range(_MOST):
        finer = Integrator(found.substeps * _FINER, found.friction)
        fine = simulate(trial.robot, logs, integrator=finer)
        with np.errstate(invalid="ignore"):  # both may be infinite
            apart = np.concatenate([(a - b)[:, counts] / level for a, b in zip(fine, coarse, strict=True)])
        if not np.sqrt(np.mean(apart**2)) > _VISIBLE:
            break
        coarse, found = fine, finer
    return None if found == own else max(log.sampling_interval for log in logs) / found.substeps


def with_fine_steps(trial: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> Trial:
    """The trial, refitted with shorter integration steps where the noise shows the error of its own."""
    if trial.angles or not trial.fitted.normalised_rms < _CLOSE:
        return trial
    step = _needs(trial, logs, noise)
    if step is None:
        return trial
    again = refit_from_itself(replace(trial.robot, longest_step=step), trial, logs, held_out, noise)
    return replace(again, id=trial.id, in_colour=trial.in_colour)
