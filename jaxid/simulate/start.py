"""Where a run starts: at rest at the origin, unless the log says otherwise.

Pose columns (x, y, theta, beta) in a log give those states. A log whose first sample already moves (by more than a tenth
of its largest speed), or shows another position than the origin, starts from what it measured, and that, with the states
nobody measures, is then uncertain.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..logs import LogSet
from ..logs.noise import noise_level
from ..robots.robot import Robot

_AT_REST = 5.0  # standard deviations of the first measurement
_STILL = 0.1
"""Share of a speed's largest value below which a first sample may as well be a sensor's offset on a robot at rest."""


@dataclass(frozen=True)
class Start:
    """Initial states of E logs: `states[name]` [E], and `uncertain` [E]: whether a log starts elsewhere."""

    states: dict[str, NDArray[np.float64]]
    uncertain: NDArray[np.bool_]


def initial_states(robot: Robot, logs: LogSet) -> Start:
    """The initial states that the logs' own columns and first samples suggest."""
    noise = noise_level(logs)
    default = robot.initial_state()
    states = {name: np.full(len(logs), default[name]) for name in robot.states}
    uncertain = np.zeros(len(logs), dtype=bool)
    measured = logs[0].channels.measured
    for e, log in enumerate(logs):
        for column in set(log.extra.columns) & set(robot.states) & {"x", "y", "theta", "beta"}:
            value = float(log.extra[column].iloc[0])
            if np.isfinite(value):
                states[column][e] = value
        for index, channel in enumerate(measured):
            if channel not in states:
                continue
            value = float(log.outputs[0, index])
            if not np.isfinite(value):
                continue
            level = noise[channel] if np.isfinite(noise[channel]) else 0.0
            largest = float(np.nanmax(np.abs(log.outputs[:, index]))) if channel in log.channels.outputs else 0.0
            # Started elsewhere than at rest at the origin: from the first sample, which is as wrong as its noise.
            least = max(_AT_REST * level, _STILL * largest)
            if abs(value - default[channel]) > least and abs(value) > 0:
                states[channel][e] = value
                uncertain[e] = True
    return Start(states, uncertain)
