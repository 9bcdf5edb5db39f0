"""Integration steps for a search: an incomplete model's residual hides their error, the noise does not.

A fit shortens its steps where they matter beside what it leaves. What a search finds is to be ranked and judged by the noise,
so that steps have to be short enough beside that, the same for all models that are compared.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..logs import LogSet
from ..robots.robot import Robot
from ..simulation.rollout import Integrator
from ..simulation.simulate import integrator_for, simulate

_FINER, _MOST = 4, 3
"""By how much steps are shortened at a time, and how often at most."""
_VISIBLE = 0.1
"""Difference that shorter steps make to the logs, RMS in units of the noise, from which steps are too long."""


def with_fine_steps(robot: Robot, logs: LogSet, noise: Mapping[str, float]) -> Robot:
    """The robot with integration steps whose error does not show beside the `noise` of these logs; as it is where shorter ones
    make no less of it, as of a chaotic motion."""
    first = found = integrator_for(robot, logs)
    counts = [np.isfinite(noise.get(name, np.nan)) for name in logs.channels.measured]
    level = np.array([noise[name] for name, ok in zip(logs.channels.measured, counts, strict=True) if ok])
    coarse, before = simulate(robot, logs, integrator=first), np.inf
    for _ in range(_MOST):
        finer = Integrator(found.substeps * _FINER, found.friction)
        fine = simulate(robot, logs, integrator=finer)
        there = [np.isfinite(log.outputs[:, counts]) for log in logs]
        with np.errstate(invalid="ignore"):  # both may be infinite
            apart = [((a - b)[:, counts] / level)[ok] for a, b, ok in zip(fine, coarse, there, strict=True)]
        error = float(np.sqrt(np.mean(np.concatenate(apart) ** 2)))
        if not error > _VISIBLE:
            break
        if not error < before:
            return robot
        coarse, found, before = fine, finer, error
    if found == first:
        return robot
    return replace(robot, longest_step=max(log.sampling_interval for log in logs) / found.substeps)
