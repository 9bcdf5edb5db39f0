"""The state at any sample of a log, from the measurement around it, and from what led there.

The measured outputs y and their slopes dy/dt, from a parabola through the neighbouring samples, are what the model's
state must explain: y = h(x) first, then, with what that leaves open, dy/dt = (dh/dx) f(x, u), by Gauss-Newton steps of least
length. A position gives a speed so, and a speed the current behind it. What neither shows (a caster's angle, a motor's
warmth) is carried along from the log's start by the model, with what they do show.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from .._float64 import in_float64
from ..logs import Log
from ..robots.robot import Robot
from .carried_states import carried
from .local_slopes import output_slopes
from .rollout import Integrator

Array = NDArray[np.float64]
_NEIGHBOURS = 9
"""Samples of the parabola."""
_STEPS = 6
_RANK = 1e-8
_ROUNDED = 1e-9
"""Share of a state below which what is left open of it is the rounding of what is not."""
_FAINT = 0.1
"""Share of what outputs or slopes show of a state elsewhere in the log below which they say nothing of it: at standstill a yaw
rate is no steering angle, however large one its noise takes there."""
_SAME = 0.01
"""Errors of the outputs, in their usual changes, that are alike: then their slopes decide which step came nearest."""
_ARRIVED = 1e-9
"""Change of outputs and slopes, in their usual changes, by a step after which there is none to go."""
_RESOLVED = 0.9
"""Share of a state that outputs and slopes resolve from which they tell it."""


def _parabolas(time: Array, values: Array, at: NDArray[np.int64]) -> tuple[NDArray[np.int64], Array, Array]:
    """The measured neighbours [W, n] of the samples `at`, how long they last [W], and the weights [W, powers, n] that their
    values have in value and slope (times that duration) of a parabola, a line or a constant through them; there is one."""
    there = np.flatnonzero(np.isfinite(values))
    count = min(_NEIGHBOURS, len(there))
    first = np.clip(np.searchsorted(there, at) - _NEIGHBOURS // 2, 0, len(there) - count)
    near = there[first[:, None] + np.arange(count)]
    span = time[near[:, -1]] - time[near[:, 0]] if count > 1 else np.ones(len(at))
    since = (time[near] - time[at][:, None]) / span[:, None]
    powers = since[..., None] ** np.arange(min(3, count))
    weights: Array = np.asarray(np.linalg.pinv(powers, rcond=count * np.finfo(float).eps), float)
    return near, span, weights


def local_parabola(time: Array, values: Array, at: NDArray[np.int64]) -> tuple[Array, Array]:
    """Value and slope [W] of `values` [T] at the samples `at`, by a parabola through the measured neighbours (a line, or
    a constant, where there are few); NaN where there is none."""
    if not np.isfinite(values).any():
        return np.full(len(at), np.nan), np.full(len(at), np.nan)
    near, span, weights = _parabolas(time, values, at)
    found = np.einsum("wpn,wn->wp", weights, values[near])
    return found[:, 0], found[:, 1] / span if weights.shape[1] > 1 else np.zeros(len(at))


def first_slope(time: Array, values: Array, noise: float) -> tuple[float, float, float]:
    """Slope of `values` [T] at their first sample, as `local_parabola` has it, its standard error for white `noise`, and the
    mean slope of the same samples; NaN where they are too few."""
    if np.count_nonzero(np.isfinite(values)) <= 3:
        return float("nan"), float("nan"), float("nan")
    near, span, weights = _parabolas(time, values, np.zeros(1, np.int64))
    own = values[near[0]]
    slope, error, mean = weights[0, 1] @ own, noise * np.linalg.norm(weights[0, 1]), own[-1] - own[0]
    return float(slope / span[0]), float(error / span[0]), float(mean / span[0])


@in_float64
def states_at_samples(
    robot: Robot, log: Log, at: NDArray[np.int64], begin: Mapping[str, float]
) -> dict[str, Float[NDArray, " W"]]:
    """The likeliest states [W] by name at the samples `at` [W] of a log that begins in the state `begin`."""
    default = {name: np.full(len(at), float(value)) for name, value in robot.initial_state().items()}
    found, certain = _by_outputs(robot, log, at, default)
    others = [name for name in robot.states if name not in certain]
    if not others or not certain:
        return found
    there = _carried_along(robot, log, certain, begin)
    with np.errstate(over="ignore", invalid="ignore"):
        if any(not np.isfinite(np.square(there[name])).all() for name in others):
            return found  # the model runs away
    return _by_outputs(robot, log, at, {**default, **{name: there[name][at] for name in others}})[0]


def _carried_along(robot: Robot, log: Log, certain: tuple[str, ...], begin: Mapping[str, float]) -> dict[str, Array]:
    """All states at all samples of a log: those that its outputs resolve, and where the model takes the others with these."""
    every = {name: np.full(len(log), value) for name, value in begin.items()}
    shown = _by_outputs(robot, log, np.arange(len(log)), every)[0]
    dt = np.diff(log.time)
    integrator = Integrator.suited(robot, log.sampling_interval)
    return carried(
        robot, integrator, begin, log.inputs, np.append(dt, dt[-1:]), {name: shown[name] for name in certain}
    )


def _clear(slopes: Array, log: Log) -> Array:
    """Which states [W, 2 ny, s] outputs show clearly at each sample, and which ones their slopes, by `slopes` in them."""
    scatter = np.array(
        [np.std(column[np.isfinite(column)]) if np.isfinite(column).any() else 0.0 for column in log.outputs.T]
    )
    sizes = np.abs(slopes) / np.tile(np.where(scatter > 0, scatter, 1.0), 2)[:, None]
    both = [np.linalg.norm(part, axis=1) for part in np.split(sizes, 2, axis=1)]
    each = [part > _FAINT * part.max(axis=0, initial=0.0) for part in both]
    return np.repeat(np.stack(each, axis=1), len(scatter), axis=1)


def _by_outputs(
    robot: Robot, log: Log, at: NDArray[np.int64], near: dict[str, Array]
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """The states [W] nearest to those given that explain the measured outputs and their slopes, and which of them these tell.
    What no sensor shows, as the robot says itself, stays as it is given."""
    names = robot.estimated_states
    measured = [np.isfinite(log.outputs[:, j]).any() for j in range(log.outputs.shape[1])]
    parabolas = [local_parabola(log.time, column, at) for column in log.outputs.T]
    target = np.concatenate([[p[0] for p in parabolas], [p[1] for p in parabolas]]).T  # [W, 2 ny]
    known = np.tile(measured, 2) & np.isfinite(target)
    target = np.where(known, target, 0.0)
    ny = log.outputs.shape[1]
    x = np.stack([near[name] for name in names], axis=1)
    shown = {name for j, name in enumerate(log.channels.measured) if measured[j]}
    open_to = np.array([name in shown or name not in robot.prior_spreads for name in names], float)
    for j, name in enumerate(log.channels.measured):
        if name in names:
            x[:, names.index(name)] = np.where(known[:, j], target[:, j], x[:, names.index(name)])
    step = log.sampling_interval
    usual = np.std(target, axis=0)
    usual = np.where(usual > 0, usual, 1.0)
    resolved, clear = np.zeros(len(names)), None
    best, least, flattest = x, np.full(len(at), np.inf), np.full(len(at), np.inf)
    for steps in range(_STEPS + 2):
        states = near | dict(zip(names, x.T, strict=True))
        seen, slopes = output_slopes(robot, names, states, log.inputs[at], step)
        error = np.where(known, target - seen, 0.0)
        slopes = np.where(known[..., None], slopes, 0.0) * open_to
        if not (np.isfinite(error).all() and np.isfinite(slopes).all()):
            break
        with np.errstate(over="ignore"):  # of a simulation that runs away: no number is nearer
            far, off = (np.linalg.norm(part, axis=1) for part in np.split(error / usual, 2, axis=1))
        nearer = (far < least - _SAME) | ((far < least + _SAME) & (off < flattest))
        best, least, flattest = (
            np.where(nearer[:, None], x, best),
            np.where(nearer, far, least),
            np.where(nearer, off, flattest),
        )
        # What a speed is comes first, from the outputs alone: at standstill no yaw rate would say anything of a steering angle.
        clear = _clear(slopes, log) if clear is None or steps == 1 else clear
        slopes = np.where(clear, slopes, 0.0)
        level = np.linalg.pinv(slopes[:, :ny], rcond=_RANK)  # [W, s, ny]
        first = np.einsum("wij,wj->wi", level, error[:, :ny])
        open_ = np.eye(len(names)) - level @ slopes[:, :ny]
        # Rounding is no way to go, which the next pseudo-inverse would take it for: it is seen in the states' own sizes.
        sizes = np.linalg.norm(slopes, axis=1)
        sizes = np.where(sizes > 0, sizes, 1.0)
        open_ = np.where(np.abs(open_) * sizes[:, :, None] > _ROUNDED * sizes[:, None, :], open_, 0.0)
        rest = error[:, ny:] - np.einsum("wij,wj->wi", slopes[:, ny:], first)
        rate = np.linalg.pinv(slopes[:, ny:] @ open_, rcond=_RANK)
        moved = first + (np.einsum("wij,wj->wi", open_ @ rate, rest) if steps else 0.0)
        x = x + moved
        left = open_ - open_ @ rate @ slopes[:, ny:] @ open_
        resolved = 1.0 - np.median(np.abs(np.diagonal(left, axis1=1, axis2=2)), axis=0)
        if steps and np.max(np.abs(np.einsum("wij,wj->wi", slopes, moved)) / usual, initial=0.0) < _ARRIVED:
            break
    certain = tuple(name for name, share in zip(names, resolved, strict=True) if share > _RESOLVED)
    return near | dict(zip(names, np.where(np.isfinite(best), best, 0.0).T, strict=True)), certain
