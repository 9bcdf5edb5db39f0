"""Short windows of logs whose outputs integrate: where a refit begins that whole logs would lead astray.

With a model that is far from whole logs of positions, a refit to them with the right effect ends anywhere: the cost of a free
simulation has minima wherever drifts cancel. In short windows, each with an initial state of its own, the same effect is found
with few steps, and from there whole logs lead on to the true minimum (multiple shooting first, single shooting after it: Bock,
Numerical Treatment of Inverse Problems in Chemical Reaction Kinetics, 1981).
"""

from collections.abc import Mapping, Sequence

import numpy as np

from ...logs import LogSet
from ...logs.windows import Windows, in_windows
from ...robots.effect import Effect
from ...robots.robot import Robot
from ...simulation.records import on_records_alone
from ...simulation.scaled import scales_of
from .refit import Trial, refit

_FAR = 5.0
"""Residual of whole logs, in units of the noise, from which they are too far off for a look of first order."""
_TIMES, _SAMPLES = 1.5, 12
"""A window's length: at least so many time constants of the robot, and so many samples."""
_FEWEST = 4
"""Windows of a log below which they are no shorter than the log to speak of."""


def integrates(robot: Robot, logs: LogSet) -> bool:
    """Whether any of the outputs measured is a position."""
    places = {*robot.positions.values(), *robot.measured_angles, *logs.channels.positions}
    return any(name in places for log in logs for name in log.measured)


def windows_to_look_in(trial: Trial, logs: LogSet, longer: float = 1.0) -> Windows | None:
    """The logs in windows, so many times as long as they need be, where the whole ones are too far from what `trial` simulates;
    else None."""
    if (
        isinstance(logs, Windows)
        or trial.angles
        or trial.fitted.normalised_rms < _FAR
        or not integrates(trial.robot, logs)
    ):
        return None
    scales = scales_of(trial.robot, logs)
    seconds = longer * max(_TIMES * scales.time, _SAMPLES * scales.interval)
    return in_windows(logs, seconds) if min(log.duration for log in logs) >= _FEWEST * seconds else None


def needs_the_past(effect: Effect, robot: Robot) -> bool:
    """Whether the effect acts on whole records of signals (a delay, a filter): it needs what came before a window."""
    return on_records_alone(effect, robot) and not effect.memoryless


def starts_from(
    robot: Robot, starts: Sequence[Mapping[str, float]], windows: Windows | None, noise: dict[str, float]
) -> list[Mapping[str, float]]:
    """`starts` for a refit of `robot` to whole logs, and where its last effect, refitted to the `windows`, leads from them.

    Not of what needs what came before a window, nor of what repeats with the wheels, whose angles are prescribed at first.
    """
    last = robot.effects[-1]
    if windows is None or last.repeats or needs_the_past(last, robot):
        return list(starts)
    there = refit(robot, starts, windows, windows, noise, {})
    if not np.isfinite(there.squares):
        return list(starts)
    return [*starts, {name: there.robot.parameters[name].value for name in there.robot.parameters.free_names}]
