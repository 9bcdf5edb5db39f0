"""The samples of all logs one after the other, as integral least squares reads them: gaps bridged, breaks marked."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...logs import Log, LogError
from ...logs.noise import noise_level
from ...robots.robot import Robot

Array = NDArray[np.float64]
_SIGNAL = 3.0  # a speed whose RMS is below this many standard deviations of its noise did not move
_LONGEST_GAP = 5  # samples that may be missing in a row before the balance is broken there


def measured_speeds(robot: Robot) -> tuple[str, ...]:
    """The states that the logs measure, in the order of the channels. Raises `LogError` if there is none."""
    names = tuple(name for name in robot.channels.outputs if name in robot.states)
    if not names:
        raise LogError(
            f"none of the outputs {list(robot.channels.outputs)} is a state of the robot {robot.name!r}, and integral "
            "least squares needs measured states; use output error for this robot."
        )
    hidden = [name for name in robot.velocities if name not in names]
    if hidden:
        raise LogError(
            f"{', '.join(hidden)} of the robot {robot.name!r} is not among the outputs {list(robot.channels.outputs)}, and "
            "integral least squares needs all its speeds; use output error for this robot."
        )
    return names


@dataclass(frozen=True)
class Rows:
    """The samples of all logs, one after the other."""

    dt: Array  # [N], 0 at the last sample of a log
    inputs: Array  # [N, nu]
    speeds: Array  # [N, nv], gaps filled by interpolation
    ahead: Array  # [N, nv], the next sample's
    first: NDArray[np.bool_]  # [N]
    start: Array  # [N, nk], positions at the start of the row's log
    seen: NDArray[np.bool_]  # [N, nv], measured here
    moved: NDArray[np.bool_]  # [N, nv], whether the log shows any motion of this speed
    whole: NDArray[np.bool_]  # [N], no gap between this sample and the next
    log: NDArray[np.int64]  # [N]
    time: Array  # [N]


def _speed(log: Log, name: str) -> Array:
    """A measured speed, from the position where only that was measured; speeds of wheels' angles are worked out before
    (`by_speeds`)."""
    values = log.output(name)
    substitute = log.channels.substitutes.get(name)
    if not np.isfinite(values).any() and isinstance(substitute, str):
        values = np.gradient(log.output(substitute), log.time)
    if np.isfinite(values).sum() < 2:
        raise LogError(
            f"{log.name}: output {name!r} has fewer than two measured values; integral least squares needs it."
        )
    return values


def _one_log(robot: Robot, log: Log, number: int, names: tuple[str, ...], positions: tuple[str, ...]) -> Rows:
    time, samples = log.time, len(log)
    values = np.stack([_speed(log, name) for name in names], axis=1)
    seen = np.isfinite(values)
    # Noise around a speed of zero is no excitation: as a regressor it would only be errors in variables.
    levels = noise_level(log)
    limits = np.array([_SIGNAL * np.nan_to_num(levels[name]) for name in names])
    rms = np.sqrt(np.nanmean(values**2, axis=0))
    moved = rms > np.maximum(limits, 1e-9 * rms.max())  # simulations leave rounding where nothing moves
    values = np.where(seen & ~moved, 0.0, values)
    filled = values.copy()
    whole = np.append(np.diff(time) <= _LONGEST_GAP * log.sampling_interval, False)
    for j in range(len(names)):
        known = np.flatnonzero(seen[:, j])
        filled[:, j] = np.interp(time, time[known], values[known, j])
        before = np.searchsorted(known, np.arange(samples), side="right") - 1
        after = np.minimum(before + 1, len(known) - 1)
        inside = (before >= 0) & (np.arange(samples) < known[-1])
        whole &= inside & (known[after] - known[np.maximum(before, 0)] <= _LONGEST_GAP)
    start = robot.initial_state()
    for name in positions:
        column = log.extra[name].to_numpy(dtype=float) if name in log.extra.columns else np.empty(0)
        if len(column) and np.isfinite(column[0]):
            start[name] = float(column[0])
    return Rows(
        dt=np.append(np.diff(time), 0.0),
        inputs=np.stack([log.input(name) for name in robot.channels.inputs], axis=1),
        speeds=filled,
        ahead=np.concatenate([filled[1:], filled[-1:]]),
        first=np.arange(samples) == 0,
        start=np.tile([float(start[name]) for name in positions], (samples, 1)).reshape(samples, len(positions)),
        seen=seen,
        moved=np.tile(moved, (samples, 1)),
        whole=whole,
        log=np.full(samples, number),
        time=np.asarray(time),
    )


def positions_of(robot: Robot, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name for name in robot.states if name not in names)


def gather(robot: Robot, logs: Iterable[Log], names: tuple[str, ...]) -> Rows:
    positions = positions_of(robot, names)
    parts = [_one_log(robot, log, number, names, positions) for number, log in enumerate(logs)]
    if not parts:
        raise LogError("There are no logs to identify from; give at least one.")
    return Rows(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in parts[0].__dict__})
