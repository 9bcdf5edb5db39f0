"""The state at any sample of a log, from the measurement around it: where windows start.

The measured outputs y and their slopes dy/dt, from a parabola through the neighbouring samples, are what the model's
state must explain: y = h(x) first, then, with what that leaves open, dy/dt = (dh/dx) f(x, u), by Gauss-Newton steps of least
length. A position gives a speed so, and a speed the current behind it. What neither shows stays as the robot starts.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ..._float64 import in_float64
from ...logs import Log, LogSet
from ...logs.noise import noise_scale
from ...logs.windows import window_rows
from ...robots.robot import Robot
from ...simulation.local_slopes import output_slopes
from .problem import Problem, Structure

Array = NDArray[np.float64]
_NEIGHBOURS = 9
"""Samples of the parabola."""
_STEPS = 6
_RANK = 1e-8
_WIDE = 100.0
"""Prior standard deviation of a window's initial states in units of the state's own spread: none to speak of."""


def local_parabola(time: Array, values: Array, at: NDArray[np.int64]) -> tuple[Array, Array]:
    """Value and slope [W] of `values` [T] at the samples `at`, by a parabola through the measured neighbours (a line, or
    a constant, where there are few); NaN where there is none."""
    there = np.flatnonzero(np.isfinite(values))
    count = min(_NEIGHBOURS, len(there))
    if not count:
        return np.full(len(at), np.nan), np.full(len(at), np.nan)
    first = np.clip(np.searchsorted(there, at) - _NEIGHBOURS // 2, 0, len(there) - count)
    near = there[first[:, None] + np.arange(count)]  # [W, samples]
    span = time[near[:, -1]] - time[near[:, 0]] if count > 1 else np.ones(len(at))
    since = (time[near] - time[at][:, None]) / span[:, None]
    powers = since[..., None] ** np.arange(min(3, count))
    found = np.einsum("wpn,wn->wp", np.linalg.pinv(powers, rcond=count * np.finfo(float).eps), values[near])
    return found[:, 0], found[:, 1] / span if count > 1 else np.zeros(len(at))


@in_float64
def states_at(robot: Robot, log: Log, at: NDArray[np.int64]) -> dict[str, Float[NDArray, " W"]]:
    """The likeliest states [W] by name at the samples `at` [W] of a log."""
    default = robot.initial_state()
    names = robot.estimated_states
    measured = [np.isfinite(log.outputs[:, j]).any() for j in range(log.outputs.shape[1])]
    parabolas = [local_parabola(log.time, column, at) for column in log.outputs.T]
    target = np.concatenate([[p[0] for p in parabolas], [p[1] for p in parabolas]]).T  # [W, 2 ny]
    known = np.tile(measured, 2) & np.isfinite(target)
    target = np.where(known, target, 0.0)
    ny = log.outputs.shape[1]
    x = np.tile([float(default[name]) for name in names], (len(at), 1))
    for j, name in enumerate(log.channels.measured):
        if name in names:
            x[:, names.index(name)] = np.where(known[:, j], target[:, j], x[:, names.index(name)])
    fixed = {name: np.full(len(at), float(value)) for name, value in default.items()}
    step = log.sampling_interval
    for _ in range(_STEPS):
        states = fixed | dict(zip(names, x.T, strict=True))
        seen, slopes = output_slopes(robot, names, states, log.inputs[at], step)
        error = np.where(known, target - seen, 0.0)
        slopes = np.where(known[..., None], slopes, 0.0)
        if not (np.isfinite(error).all() and np.isfinite(slopes).all()):
            break
        level = np.linalg.pinv(slopes[:, :ny], rcond=_RANK)  # [W, s, ny]
        first = np.einsum("wij,wj->wi", level, error[:, :ny])
        open_ = np.eye(len(names)) - level @ slopes[:, :ny]
        rest = error[:, ny:] - np.einsum("wij,wj->wi", slopes[:, ny:], first)
        rate = np.linalg.pinv(slopes[:, ny:] @ open_, rcond=_RANK)
        x = x + first + np.einsum("wij,wj->wi", open_ @ rate, rest)
    return fixed | dict(zip(names, np.where(np.isfinite(x), x, 0.0).T, strict=True))


def started(robot: Robot, logs: LogSet, seconds: float, structure: Structure, problem: Problem) -> Problem:
    """`problem`, of the windows of `logs`, with initial states from the measurement around where each window starts."""
    parts = [states_at(robot, log, np.array([k.start for k in window_rows(log, seconds)])) for log in logs]
    states = {name: np.concatenate([part[name] for part in parts]) for name in robot.states}
    scales, precision = np.array(problem.state_scale), np.array(problem.state_precision)
    for i, name in enumerate(structure.state_names):
        if name in states:
            spread = float(np.std(states[name]))
            scales[i] = spread if spread > 0 else scales[i]
            precision[i] = (_WIDE * scales[i]) ** -2
    noise = noise_scale(logs)
    return replace(
        problem,
        sigma=np.asarray([noise[name] for name in logs.channels.measured]),
        start={**problem.start, **{name: np.asarray(value) for name, value in states.items()}},
        state_scale=np.asarray(scales),
        state_precision=np.asarray(precision),
    )
