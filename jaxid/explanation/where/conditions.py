"""Under which conditions a robot was at each sample of a log: standing, slow, reversing, turning, heading, place, time.

All conditions are read off the measured speeds (mean over up to five samples) and the inputs, never off a residual. Each is
one small function of a `Motion`, and to add one is to write it and to name it in `conditions_of`. Thresholds relate to what
the robot did in all logs of the set together: `fastest` is the speed that a drive axis exceeds in 5 % of the samples.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...logs import Log, LogSet, noise_level
from ...robots.robot import Robot
from ...simulation.reckoning import measured_states, measured_velocities, reckoned
from ...simulation.scaled import axis_map, scales_of
from ...simulation.start import states_at

Mask = NDArray[np.bool_]
Signal = NDArray[np.float64]

_MEAN_OVER, _MOST_SAMPLES = 0.7, 5
"""Time constants of the robot over which measured speeds are averaged, and how many samples that may be at most."""
_NEAR_REVERSAL = 2.0
"""Time constants of the robot on either side of a reversal that count as near it."""
_STILL = 0.03
"""Share of the fastest speed below which, or below three standard deviations of what noise is left, an axis is still."""
_SLOW, _FAST = 0.1, 0.8
_STRAIGHT = 0.15
_NEAR_LARGEST = 0.9


@dataclass(frozen=True)
class Motion:
    """What the conditions look at in one log of T samples.

    - `time` [T] s, and the time on either side of a reversal that is `near` it.
    - `inputs` [T, nu] and `largest` [nu], the largest magnitude of each in the set.
    - `axes` [T, n]: speeds of the drive axes (rim speeds of a Pioneer's wheels; V, Vn, b W of an omni), with
      `axis_names` where each is a velocity of its own; the speed below which each is `still` and its `fastest` speed
      (endless for one that never moves), both [n].
    - `ahead` [T]: speed forwards, `turning` [T]: yaw rate to the left (None where there is none), each with the speed
      that it exceeds in 5 % of the samples.
    - `heading` [T] rad and `path` [T, 2] in the `length_unit` by dead reckoning from the measured speeds, and the `middle`
      [2] of all paths; None where a robot has none.
    """

    time: Signal
    near: float
    inputs: Signal
    largest: Signal
    axes: Signal
    axis_names: tuple[str, ...]
    still: Signal
    fastest: Signal
    ahead: Signal
    ahead_fastest: float
    turning: Signal | None
    turning_fastest: float
    heading: Signal | None
    path: Signal | None
    middle: Signal | None
    length_unit: str = "m"


@dataclass(frozen=True)
class Condition:
    """A condition: `name` for tables, `phrase` for a sentence ("within 0.4 s of a reversal"), and its function."""

    name: str
    phrase: str
    holds: Callable[[Motion], Mask]


# -- conditions ----------------------------------------------------------------------------------------------------
def standstill(motion: Motion) -> Mask:
    """Every drive axis is still: below 3 % of its fastest speed, or below what noise can show."""
    return np.all(np.abs(motion.axes) <= motion.still, axis=1)


def low_speed(motion: Motion) -> Mask:
    """Not at standstill, and some drive axis below 10 % of its fastest speed."""
    slow = np.any(np.abs(motion.axes) <= np.maximum(_SLOW * motion.fastest, motion.still), axis=1)
    return slow & ~standstill(motion)


def high_speed(motion: Motion) -> Mask:
    """Some drive axis above 80 % of its fastest speed."""
    return np.any(np.abs(motion.axes) >= _FAST * motion.fastest, axis=1)


def forward(motion: Motion) -> Mask:
    """Driving forwards, faster than 3 % of the fastest."""
    return motion.ahead > _STILL * motion.ahead_fastest


def backward(motion: Motion) -> Mask:
    """Driving backwards, faster than 3 % of the fastest."""
    return motion.ahead < -_STILL * motion.ahead_fastest


def near_reversal(motion: Motion, axis: int | None = None) -> Mask:
    """Within `near` of the moment at which a drive axis (or the given one) starts, having last moved the other way."""
    near = np.zeros(len(motion.time), dtype=bool)
    for i in range(motion.axes.shape[1]) if axis is None else (axis,):
        moving = np.flatnonzero(np.abs(motion.axes[:, i]) > motion.still[i])
        sign = np.sign(motion.axes[moving, i])
        for k in np.flatnonzero(sign[1:] != sign[:-1]):
            # From the last sample that moves one way to the first that moves the other, a stop in between included
            # only up to the same time.
            last, first = motion.time[moving[k]], motion.time[moving[k + 1]]
            near |= np.abs(motion.time - last) <= motion.near
            near |= np.abs(motion.time - first) <= motion.near
    return near


def axis_slow(motion: Motion, axis: int) -> Mask:
    """One drive axis still or below 10 % of its fastest speed while the robot moves."""
    slow = np.abs(motion.axes[:, axis]) <= max(_SLOW * motion.fastest[axis], motion.still[axis])
    return slow & ~standstill(motion)


def turning_left(motion: Motion) -> Mask:
    """Yaw rate to the left above 15 % of the fastest."""
    assert motion.turning is not None
    return motion.turning > _STRAIGHT * motion.turning_fastest


def turning_right(motion: Motion) -> Mask:
    """Yaw rate to the right above 15 % of the fastest."""
    assert motion.turning is not None
    return motion.turning < -_STRAIGHT * motion.turning_fastest


def straight(motion: Motion) -> Mask:
    """Moving, with a yaw rate below 15 % of the fastest."""
    assert motion.turning is not None
    return (np.abs(motion.turning) <= _STRAIGHT * motion.turning_fastest) & ~standstill(motion)


def heading_quadrant(motion: Motion, quadrant: int) -> Mask:
    """Heading within 45° of `quadrant` times 90° from where the log's robot faced at heading zero."""
    assert motion.heading is not None
    return np.floor(motion.heading / (np.pi / 2) + 0.5).astype(int) % 4 == quadrant


def beyond_middle(motion: Motion, axis: int, sign: int) -> Mask:
    """On one side of the middle (median) of all driven paths, along world x (0) or y (1)."""
    assert motion.path is not None and motion.middle is not None
    return sign * (motion.path[:, axis] - motion.middle[axis]) > 0


def near_largest_input(motion: Motion) -> Mask:
    """Some input above 90 % of the largest magnitude it has in any log."""
    return np.any(np.abs(motion.inputs) >= _NEAR_LARGEST * motion.largest, axis=1)


def third(motion: Motion, number: int) -> Mask:
    """First (0), middle (1) or last (2) third of the run."""
    share = (motion.time - motion.time[0]) / (motion.time[-1] - motion.time[0])
    return np.minimum(np.floor(3 * share), 2).astype(int) == number


_QUADRANTS = ("ahead", "left", "back", "right")
_THIRDS = ("first", "middle", "last")


def conditions_of(motion: Motion) -> tuple[Condition, ...]:
    """The conditions that make sense for this robot."""
    found = [
        Condition("standstill", "at standstill", standstill),
        Condition("low speed", "at low speed", low_speed),
        Condition("high speed", "at high speed", high_speed),
        Condition("near a reversal", f"within {motion.near:.2g} s of a reversal", near_reversal),
        Condition("forward", "driving forwards", forward),
        Condition("backward", "driving backwards", backward),
    ]
    if len(motion.axis_names) > 1:
        for i, name in enumerate(motion.axis_names):
            slow, reversed_ = (lambda m, i=i: axis_slow(m, i)), (lambda m, i=i: near_reversal(m, i))
            found.append(Condition(f"{name} slow", f"at low speed of {name}", slow))
            phrase = f"within {motion.near:.2g} s of a reversal of {name}"
            found.append(Condition(f"near a reversal of {name}", phrase, reversed_))
    if motion.turning is not None:
        found += [
            Condition("turning left", "turning left", turning_left),
            Condition("turning right", "turning right", turning_right),
            Condition("straight", "driving straight", straight),
        ]
    if motion.heading is not None:
        for i, name in enumerate(_QUADRANTS):
            phrase = f"heading within 45° of {90 * i}°"
            found.append(Condition(f"heading {90 * i}° ({name})", phrase, lambda m, i=i: heading_quadrant(m, i)))
    if motion.path is not None and motion.middle is not None:
        for axis in range(motion.path.shape[1]):
            place, letter = float(motion.middle[axis]), "xy"[axis]
            for sign, sense in ((1, ">"), (-1, "<")):
                text = f"{letter} {sense} {place:{'.2g' if abs(place) < 100 else '.0f'}} {motion.length_unit}"
                found.append(Condition(text, f"where {text}", lambda m, a=axis, s=sign: beyond_middle(m, a, s)))
    found.append(Condition("near largest input", "near the largest input", near_largest_input))
    for i, name in enumerate(_THIRDS):
        found.append(Condition(f"{name} third", f"in the {name} third of the run", lambda m, i=i: third(m, i)))
    return tuple(found)


# -- what they look at ---------------------------------------------------------------------------------------------
def _averaged(values: Signal, samples: int) -> Signal:
    """Centred mean over an odd number of samples; a gap is filled from its neighbours."""
    known = np.isfinite(values)
    if not known.any():
        return np.zeros_like(values)
    filled = np.interp(np.arange(len(values)), np.flatnonzero(known), values[known])
    padded = np.pad(filled, samples // 2, mode="edge")
    return np.convolve(padded, np.ones(samples) / samples, mode="valid")


def _samples(log: Log, time_constant: float) -> int:
    """Over how many samples of a log its speeds are averaged; an odd number."""
    return 2 * round((min(_MEAN_OVER * time_constant / log.sampling_interval, _MOST_SAMPLES) - 1.0) / 2.0) + 1


def _speeds(robot: Robot, log: Log, samples: int) -> dict[str, Signal]:
    """The velocities of the robot that the log shows, averaged over `samples`.

    Those that no sensor, position or readout tells (a car of which a camera sees place and heading) are the likeliest ones by
    the outputs' own slopes.
    """
    found = measured_velocities(robot, log, lambda values: _averaged(values, samples))
    hidden = [name for name, values in found.items() if not np.isfinite(values).any() and name in robot.states]
    if hidden:
        states = states_at(robot, log, np.arange(len(log)))
        found |= {name: states[name] for name in hidden}
    return {name: _averaged(values, samples) for name, values in found.items()}


def _axis_names(robot: Robot, axes: Signal) -> tuple[str, ...]:
    """Names of the axes where the robot tells them apart in words; a Pioneer's two wheels are alike."""
    return robot.axis_words if axes.shape[1] == len(robot.axis_words) else ()


def dead_reckoned(robot: Robot, log: Log, speeds: dict[str, Signal]) -> tuple[Signal | None, Signal | None]:
    """Heading [T] rad and world positions [T, 2 or 1] m from speeds; None for a robot of which they are not known."""
    columns = {name: log.extra[name] for name in ("x", "y", "theta") if name in log.extra.columns}
    start = {name: float(values.iloc[0]) for name, values in columns.items()}
    return reckoned(robot, measured_states(robot, log) | speeds, np.diff(log.time), start)


def _fastest(values: list[Signal]) -> Signal:
    """Of every column, or of the one signal (no axis)."""
    return np.asarray(np.quantile(np.abs(np.concatenate(values)), 0.95, axis=0))


def motions(robot: Robot, logs: LogSet) -> tuple[Motion, ...]:
    """What the conditions look at, for every log."""
    noise = noise_level(logs)
    time_constant = scales_of(robot, logs).time
    samples = [_samples(log, time_constant) for log in logs]
    speeds = [_speeds(robot, log, n) for log, n in zip(logs, samples, strict=True)]
    names = list(speeds[0])
    to_axes = axis_map(robot, names)
    axes = [np.stack([own[name] for name in names], axis=1) @ to_axes for own in speeds]
    fastest = _fastest(axes)
    # What is left of the noise on an axis after the mean over time.
    level = np.nan_to_num([noise.get(name, 0.0) for name in names])
    left = np.linalg.norm(level[:, None] * to_axes, axis=0) / np.sqrt(min(samples))
    still = np.maximum(_STILL * fastest, 3.0 * left)
    reckoned = [dead_reckoned(robot, log, own) for log, own in zip(logs, speeds, strict=True)]
    paths = [path for _, path in reckoned if path is not None]
    middle = np.median(np.concatenate(paths), axis=0) if paths else None
    largest = np.max([np.max(np.abs(log.inputs), axis=0) for log in logs], axis=0)
    near = _NEAR_REVERSAL * time_constant
    main, turn = names[0], robot.turning if robot.turning in names else None
    return tuple(
        Motion(
            time=log.time,
            near=near,
            inputs=log.inputs,
            largest=np.where(largest > 0, largest, np.inf),
            axes=axes[e],
            axis_names=_axis_names(robot, axes[e]),
            still=still,
            fastest=np.where(fastest > 0, fastest, np.inf),
            ahead=speeds[e][main],
            ahead_fastest=float(_fastest([own[main] for own in speeds])),
            turning=speeds[e][turn] if turn else None,
            turning_fastest=float(_fastest([own[turn] for own in speeds])) if turn else 0.0,
            heading=reckoned[e][0],
            path=reckoned[e][1],
            middle=middle,
            length_unit=robot.length_unit,
        )
        for e, log in enumerate(logs)
    )
