"""Where logs start that a model was not fitted to.

A held-out log that begins in motion shows its first speed only through the noise, and a caster's angle not at all. A
simulation from there would be judged by the first sample's error for as long as that takes to die away. So a few numbers
per log, its initial states, are estimated from the log itself, with all parameters held.
"""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from ...logs import LogSet
from ...robots.robot import Robot
from ...simulation.simulate import integrator_for, simulate
from ...simulation.start import free_states, initial_states

_STEPS = 5
_SECANT = 1e-3
_FELT, _TRIES = (1e-3, 1e3), 12
"""Change of a residual, in units of the noise, by which a secant is neither rounding nor curved, and how often its length
is changed by a thousand to get there."""
_CURVED = 10.0
"""The same beyond which the secant of a measured state is shortened: what is off by the noise grows many times over in a motion
that is unstable, and bends.
"""
_SHRINK = (1.0, 0.3, 0.05)
"""Shares of a Gauss-Newton step that are tried."""
_NOTICEABLE = 0.01
_TRIED = np.linspace(-np.pi, np.pi, 24, endpoint=False)
"""Values that are tried of an angle [rad] that the outputs tell in many ways."""
_DIVERGED = 1e6
_HORIZONS = (0.125, 0.25, 0.5, 1.0)
"""Shares of a log, from its start, over which its initial state is estimated one after the other where the whole leads
nowhere: what is off at the start of an unstable motion is out of sight at its end."""
_LOST, _FEWEST = 2.0, 10
"""Residual in units of the noise from which that is so, and samples of the shortest share."""


def estimated_start(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float],
    prescribed: Mapping[str, Float[Array, "E T"]] = MappingProxyType({}),
) -> dict[str, NDArray[np.float64]]:
    """Initial states [E] by name: those that the log leaves open the likeliest ones (Gauss-Newton), the others as
    `initial_states` has them. `noise` is each channel's standard deviation."""
    begin = initial_states(robot, logs)
    states, free = begin.states, free_states(robot, logs, begin)
    moving = np.any(free, axis=1, keepdims=True)[:, 0]
    if not moving.any():
        return states
    measured = logs.channels.measured
    names = robot.estimated_states
    counted = [c for c in measured if np.isfinite(noise.get(c, np.nan)) and (c in logs.channels.outputs or c in names)]
    columns, sigma = [measured.index(c) for c in counted], np.array([noise[c] for c in counted])
    prior = np.array([0.0 if name in counted else 1.0 / robot.prior_spreads.get(name, np.inf) for name in names])
    origin = np.stack([states[name] for name in names], axis=1)
    steps = integrator_for(robot, logs)

    def residuals(x: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        start = {**states, **dict(zip(names, x.T, strict=True))}
        found = []
        for e, (log, simulated) in enumerate(
            zip(logs, simulate(robot, logs, start=start, integrator=steps, prescribed=prescribed), strict=True)
        ):
            error = (simulated[:, columns] - log.outputs[:, columns]) / sigma
            error = np.where(np.isfinite(log.outputs[:, columns]), np.nan_to_num(error, nan=_DIVERGED), 0.0)
            error[max(int(horizon * len(log)), min(_FEWEST, len(log))) :] = 0.0
            found.append(np.concatenate([np.clip(error, -_DIVERGED, _DIVERGED).ravel(), prior * (x[e] - origin[e])]))
        return found

    def costs(found: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        return np.array([float(r @ r) for r in found])

    x, horizon, searched = origin.copy(), 1.0, moving
    now = residuals(x)
    best = costs(now)

    def tried(there: NDArray[np.float64]) -> None:
        """Go there with every log that fits better there."""
        nonlocal x, now, best
        there = np.where(searched[:, None] & free, there, x)
        then = residuals(there)
        better = costs(then) < best
        x = np.where(better[:, None], there, x)
        now = [b if ok else a for a, b, ok in zip(now, then, better, strict=True)]
        best = costs(now)

    for j, name in enumerate(names):
        for value in _TRIED if name in robot.ambiguous else ():
            tried(np.where(np.arange(len(names)) == j, value, x))
    spreads = robot.prior_spreads
    lengths = [noise[name] if name in counted else _SECANT * spreads.get(name, 1.0) for name in names]
    for j, name in enumerate(names):
        for _ in range(_TRIES if name not in counted and name not in spreads else 0):
            there = residuals(x + lengths[j] * (np.arange(len(names)) == j))
            felt = max(float(np.max(np.abs(a - b))) for a, b in zip(there, now, strict=True))
            if felt == 0.0 or _FELT[0] < felt < _FELT[1]:
                break
            lengths[j] *= 1e3 if felt <= _FELT[0] else 1e-3
        if name in counted:
            there = residuals(x + lengths[j] * (np.arange(len(names)) == j))
            felt = max(float(np.max(np.abs(a - b))) for a, b in zip(there, now, strict=True))
            lengths[j] *= min(1.0, _CURVED / max(felt, 1e-300))

    def descend(share: float) -> None:
        """Gauss-Newton steps of the logs that are searched, over that share of them."""
        nonlocal now, best, horizon
        horizon = share
        now = residuals(x)
        best = costs(now)
        for _ in range(_STEPS):
            before = best
            moved = [residuals(x + length * unit) for length, unit in zip(lengths, np.eye(len(names)), strict=True)]
            step, promised = np.zeros_like(x), np.zeros(len(x))
            for e in np.flatnonzero(searched):
                jacobian = np.stack([m[e] - now[e] for m in moved], axis=1) * free[e]
                way = np.linalg.lstsq(jacobian, now[e], rcond=1e-10)[0]
                promised[e] = best[e] - np.sum((now[e] - jacobian @ way) ** 2)
                step[e] = -np.array(lengths) * way
            start, waits = x, promised > _NOTICEABLE
            for shrunk in _SHRINK:
                if waits.any():
                    tried(np.where(waits[:, None], start + shrunk * step, x))
                    waits &= ~(best < before)
            if not np.any(best < before - _NOTICEABLE):
                break

    descend(1.0)
    size = np.array([np.count_nonzero(np.isfinite(log.outputs[:, columns])) for log in logs])
    searched = moving & (best > _LOST**2 * np.maximum(size, 1))
    if searched.any():
        found, left = x, best
        x = np.where(searched[:, None], origin, x)
        for share in _HORIZONS:
            descend(share)
        x = np.where((best < left)[:, None], x, found)
    return {**states, **dict(zip(names, x.T, strict=True))}
