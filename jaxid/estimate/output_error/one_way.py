"""Logs in which the robot drives one way only: what always pushes alike is then dry friction.

A slope under a robot that never turns round, an offset of its input, friction that is larger one way than the other: while the
robot rolls one way, all of them are a constant force, which the Coulomb friction takes up. Such a model predicts motion like
that of its logs, and no residual says that its friction is half of the truth.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from ...logs import Log, LogSet
from ...parameters import ParameterError
from ...robots.robot import Robot
from ...simulation.simulate import simulate
from ...simulation.start import initial_states
from ..result import Fit

_AGAINST = 0.05
"""Share of an axis' largest speed below which it does not go that way: a sensor's noise, or a moment of swinging back."""
_STEP = 0.1


def _driven_both_ways(robot: Robot, logs: LogSet) -> bool:
    """Whether an input that drives is of both signs in the logs: that most robots then roll both ways is soon said."""
    inputs = np.concatenate([log.inputs[:, list(robot.drive_inputs)] for log in logs])
    least = _AGAINST * np.max(np.abs(inputs), axis=0, initial=0.0)
    return bool(np.any(np.any(inputs > least, axis=0) & np.any(inputs < -least, axis=0)))


def _velocities(robot: Robot, logs: LogSet) -> list[dict[str, Float[np.ndarray, " T"]]] | None:
    """The velocities of every log, as simulated; None where the robot cannot show them."""
    names, seen = tuple(name for name in robot.velocities if name in robot.own_states), robot.channels.outputs
    bare = replace(robot, effects=())
    if all(name in seen for name in names):
        return [{name: y[:, seen.index(name)] for name in names} for y in map(np.asarray, simulate(bare, logs))]
    shown = bare.showing(names)
    if shown is None:
        return None
    still = [np.zeros((len(log), len(names))) for log in logs]
    asked = [Log(log.name, log.time, log.inputs, y, shown.channels) for log, y in zip(logs, still, strict=True)]
    start = {name: own for name, own in initial_states(robot, logs).states.items() if name in shown.states}
    return [dict(zip(names, np.asarray(y).T, strict=True)) for y in simulate(shown, LogSet(asked), start=start)]


def _rubbing(robot: Robot, axes: Sequence[int], velocities: dict[str, Float[np.ndarray, " T"]]) -> np.ndarray:
    """Speeds [axes, T] at which the axes rub."""
    length = len(next(iter(velocities.values())))
    rest = {name: np.full(length, float(value)) for name, value in robot.initial_state().items()}
    speeds = robot.rubbing({**rest, **velocities}, robot.parameters.numbers)
    return np.stack([np.broadcast_to(np.asarray(speeds[i], float), (length,)) for i in axes])


def _axes_of(robot: Robot, name: str) -> list[int]:
    """The axes whose Coulomb friction depends on a parameter."""
    state, numbers = dict(robot.initial_state()), robot.parameters.numbers
    here = robot.own_coulomb(state, numbers)
    there = robot.own_coulomb(state, {**numbers, name: numbers[name] * (1.0 + _STEP) + _STEP})
    return [i for i, (a, b) in enumerate(zip(here, there, strict=True)) if tuple(map(float, a)) != tuple(map(float, b))]


def one_way(fit: Fit, logs: LogSet) -> str:
    """A sentence on identified Coulomb friction of axes that turn one way only in all of the `logs`, as the fitted robot moves
    in them; empty where there is none."""
    robot = fit.robot
    friction = {name: _axes_of(robot, name) for name in fit.free_names if fit[name].status == "identified"}
    friction = {name: axes for name, axes in friction.items() if axes}
    if not friction or robot.controlled or _driven_both_ways(robot, logs):
        return ""
    try:
        velocities = _velocities(robot, logs)
    except ParameterError:  # too fast for any steps without its effects
        return ""
    if velocities is None:
        return ""
    found = []
    for name, axes in friction.items():
        speeds = np.concatenate([_rubbing(robot, axes, own) for own in velocities], axis=1)
        speeds = speeds[:, np.all(np.isfinite(speeds), axis=0)]
        least = _AGAINST * np.max(np.abs(speeds), axis=1, initial=0.0)[:, None]
        moves = np.max(np.abs(speeds), axis=1, initial=0.0) > 0.0
        both = np.any(speeds > least, axis=1) & np.any(speeds < -least, axis=1)
        if moves.any() and not both[moves].any():
            found.append(name)
    if not found:
        return ""
    they, hold = " and ".join(found), "hold" if len(found) > 1 else "holds"
    return (
        f"In all of these logs the robot drives one way: {they} {hold} whatever else pushes alike all the time (a slope, an "
        "offset of an input, friction that is another one backwards), and may be off by as much. Logs that drive the other "
        "way, too, would tell."
    )
