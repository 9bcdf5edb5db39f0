"""What other values of the free parameters would take up of a residual, to first order: no effect is missing for that.

Under slow noise a fit is off by several times what independent samples would allow, and what it predicts of held-out logs is
then off along the motion, as it would be if something were missing. What is asked of a residual is what no values of the
parameters explain, the same ones on all logs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...estimate.noise_colour import Colour
from ...estimate.output_error.estimated_start import estimated_start
from ...logs import LogSet
from ...robots.robot import Robot
from ...simulation.simulate import integrator_for, simulate_models
from ..left.coloured import colours_of, whitened
from ..left.heldout import HeldOut, scaled_residuals

Array = NDArray[np.float64]

_STEP = 1e-3
"""Step of the secants, in units of a parameter's magnitude."""


def _columns(robot: Robot, state: HeldOut, logs: LogSet) -> list[Array]:
    """What steps of the free parameters do to the residuals of every log, each [T, channels, parameters]."""
    table = robot.parameters
    others = []
    for name in table.free_names:
        size = max(abs(table[name].value), table[name].typical or 0.0, np.finfo(float).tiny)
        up = table[name].value + _STEP * size <= table[name].upper
        others.append(robot.with_values(**{name: table[name].value + (_STEP if up else -_STEP) * size}))
    by_log = simulate_models(
        [robot, *others],
        logs,
        start=estimated_start(robot, logs, state.noise),
        integrator=integrator_for(robot, logs),
    )
    outputs = [scaled_residuals(logs, [y[k] for y in by_log], state.noise) for k in range(1 + len(others))]
    return [np.stack([moved[e] - outputs[0][e] for moved in outputs[1:]], axis=-1) for e in range(len(logs))]


def less_absorbed(robot: Robot, states: Sequence[tuple[HeldOut, LogSet]]) -> list[tuple[HeldOut, LogSet]]:
    """The `states` that `robot` leaves on their logs, less what the same other values of its free parameters would take up of
    all of them together (generalised least squares, the noise coloured as they are)."""
    count = len(robot.parameters.free_names)
    if not count or any(state.diverged for state, _ in states):
        return list(states)
    every = [_columns(robot, state, logs) for state, logs in states]
    # Coloured samples are fewer independent ones: weighed like white ones, they would move what the white ones say.
    colours = colours_of([state for state, _ in states])
    white = [whitened(state, colours).residuals for state, _ in states]
    residual = np.concatenate([np.nan_to_num(r).ravel() for own in white for r in own])
    columns = np.stack([_whitened_column(states, every, colours, i) for i in range(count)], axis=1)
    size = np.linalg.norm(columns, axis=0)
    if not np.isfinite(size).all():
        return list(states)
    size = np.where(size > 0, size, 1.0)
    moved = -np.linalg.lstsq(columns / size, residual, rcond=1e-6)[0] / size
    found = []
    for (state, logs), own in zip(states, every, strict=True):
        left = tuple(r + change @ moved for r, change in zip(state.residuals, own, strict=True))
        found.append((replace(state, residuals=left), logs))
    return found


def _whitened_column(
    states: Sequence[tuple[HeldOut, LogSet]],
    every: Sequence[Sequence[Array]],
    colours: Mapping[str, Colour],
    parameter: int,
) -> Array:
    found = []
    for (state, _), own in zip(states, every, strict=True):
        # Where nothing was measured, as the residuals have it.
        changes = tuple(
            np.where(np.isfinite(r), np.nan_to_num(change[:, :, parameter]), np.nan)
            for r, change in zip(state.residuals, own, strict=True)
        )
        found += [np.nan_to_num(r).ravel() for r in whitened(replace(state, residuals=changes), colours).residuals]
    return np.concatenate(found)
