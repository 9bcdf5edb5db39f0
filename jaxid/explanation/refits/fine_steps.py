"""Integration steps for what a search found: an incomplete model's residual hides their error, the noise does not.

A fit shortens its steps where they matter beside what it leaves. A model that has become better is ranked among its rivals and
judged by the noise, so that steps have to be short enough beside that, the same for all that are near.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...logs import LogSet
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ...simulation.simulate import integrator_for, simulate
from ..search.laws import best_first
from ..search.steps import Step
from ..search.telling_apart import alike, not_told_apart, simplest_first, supersets
from .candidate_refits import Report
from .refit import Trial, refit_from_itself

_FINER, _MOST = 4, 3
"""By how much steps are shortened at a time, and how often at most."""
_NEAR = 20.0
"""Residual in units of the noise up to which a model is near: of others no integration error decides anything."""
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


def ranked_with_fine_steps(step: Step, logs: LogSet, held_out: LogSet, noise: dict[str, float], say: Report) -> Step:
    """The step with its models that are near refitted with steps short enough for the best of them, and ranked again."""
    best = step.chosen
    if best.angles or best.in_colour is not None or not best.fitted.normalised_rms < _NEAR:
        return step
    longest = with_fine_steps(best.robot, logs, noise).longest_step
    if longest == best.robot.longest_step:
        return step
    say("integration steps were too long beside the noise; refitting with shorter ones")
    again: dict[int, Trial] = {}
    for trial in (*step.trials, *step.laws):
        if id(trial) not in again and not trial.angles and trial.fitted.normalised_rms < _NEAR:
            finer = replace(trial.robot, longest_step=longest)
            again[id(trial)] = replace(refit_from_itself(finer, trial, logs, held_out, noise), id=trial.id)
    every = [again.get(id(trial), trial) for trial in step.trials]
    trials = simplest_first(sorted((t for t in every if t.id not in step.refused), key=lambda trial: trial.score))
    refused = [trial for trial in every if trial.id in step.refused]
    laws = [again.get(id(trial), trial) for trial in step.laws]
    laws = best_first(laws) if laws and laws[0].id == trials[0].id else [trials[0]]
    trials[0] = laws[0]
    equivalent = tuple(name for name in not_told_apart(trials, step.before) if name not in supersets(trials))
    same = tuple(trial.law for trial in alike(laws))
    return replace(
        step, trials=(*trials, *refused), equivalent=equivalent, after=trials[0], laws=tuple(laws), laws_alike=same
    )
