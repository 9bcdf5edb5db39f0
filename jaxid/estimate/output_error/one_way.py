"""Logs in which the robot drives one way only: what always pushes alike is then dry friction.

A slope under a robot that never turns round, an offset of its input, friction that is larger one way than the other: while the
robot rolls one way, all of them are a constant force, which the Coulomb friction takes up. Such a model predicts motion like
that of its logs, and no residual says that its friction is half of the truth.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from ..._float64 import in_float64
from ...logs import Log, LogSet
from ...logs.noise import white_level
from ...parameters import ParameterError
from ...robots.effect import State
from ...robots.rates_in_motion import rates_in_motion
from ...robots.robot import Robot
from ...simulation.simulate import simulate
from ...simulation.start import initial_states
from ..result import Fit

ONE_WAY = "In all of these logs the robot drives one way"
_AGAINST = 0.05
"""Share of an axis' largest speed below which it does not go that way: a sensor's noise, or a moment of swinging back."""
_MOMENTS = 0.05
"""Share of the samples on either side that say nothing of the way in which a robot moves."""
_LOUD = 3.0
"""Times its noise that a measured speed has to be for a motion."""
_BEYOND_NOISE = 0.4
"""Share of its largest from which a measured speed has the sign of the motion."""
_STEP = 0.1
_STATES = 50
"""Moving states in which the rates of the robot are compared."""
_ALIKE = 1e-8


def _driven_both_ways(robot: Robot, logs: LogSet) -> bool:
    """Whether an input that drives is of both signs in the logs, and so is a velocity, where one is measured: that most robots
    then roll both ways is soon said."""
    inputs = np.concatenate([log.inputs[:, list(robot.drive_inputs)] for log in logs])
    least = _AGAINST * np.max(np.abs(inputs), axis=0, initial=0.0)
    if not np.any(np.any(inputs > least, axis=0) & np.any(inputs < -least, axis=0)):
        return False
    seen = [name for name in robot.velocities if name in robot.channels.outputs]
    measured = [np.concatenate([log.output(name) for log in logs]) for name in seen]
    measured = [y[np.isfinite(y)] for y in measured]
    return not seen or any(_both(y) for y in measured if len(y))


def _both(y: Float[np.ndarray, " N"]) -> bool:
    """Whether a measured velocity is of both signs for more than moments and by more than its noise, which a robot that stands
    shows, too."""
    low, high = np.quantile(y, (_MOMENTS, 1.0 - _MOMENTS))
    return bool(min(-low, high) > max(_AGAINST * max(-low, high), _LOUD * white_level(y)))


def _measured_velocities(robot: Robot, logs: LogSet) -> list[dict[str, Float[np.ndarray, " T"]]] | None:
    """The velocities of every log, as measured; None where one is not."""
    names = [name for name in robot.velocities if name in robot.own_states]
    if not names or any(name not in log.measured for log in logs for name in names):
        return None
    return [{name: log.output(name) for name in names} for log in logs]


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


def _of_one_way(
    fit: Fit, logs: LogSet, names: Sequence[str], measured: bool = False
) -> tuple[list[str], list[dict[str, np.ndarray]]]:
    """Those of the parameters `names` that are Coulomb friction of axes that turn one way only in all of the `logs`, as the
    fitted robot moves in them or as was `measured`, and the velocities of every log; none where nothing shows them."""
    robot = fit.robot
    friction = {name: axes for name in names if (axes := _axes_of(robot, name))}
    if not friction or robot.controlled or _driven_both_ways(robot, logs):
        return [], []
    try:
        velocities = (_measured_velocities if measured else _velocities)(robot, logs)
    except ParameterError:  # too fast for any steps without its effects
        return [], []
    found = []
    for name, axes in friction.items() if velocities is not None else ():
        speeds = np.concatenate([_rubbing(robot, axes, own) for own in velocities or ()], axis=1)
        speeds = speeds[:, np.all(np.isfinite(speeds), axis=0)]
        least = _AGAINST * np.max(np.abs(speeds), axis=1, initial=0.0)[:, None]
        if measured:
            least = np.maximum(least, _LOUD * np.array([[white_level(own)] for own in speeds]))
        moves = np.max(np.abs(speeds), axis=1, initial=0.0) > 0.0
        # Of noise one sample in a thousand is as large.
        share = _MOMENTS if measured else 0.0
        both = (np.mean(speeds > least, axis=1) > share) & (np.mean(speeds < -least, axis=1) > share)
        if moves.any() and not both[moves].any():
            found.append(name)
    return found, velocities or []


def one_way(fit: Fit, logs: LogSet) -> str:
    """A sentence on identified Coulomb friction of axes that turn one way only in all of the `logs`, as the fitted robot moves
    in them; empty where there is none."""
    found, _ = _of_one_way(fit, logs, [name for name in fit.free_names if fit[name].status == "identified"])
    if not found:
        return ""
    they, hold = " and ".join(found), "hold" if len(found) > 1 else "holds"
    return (
        f"{ONE_WAY}: {they} {hold} whatever else pushes alike all the time (a slope, an offset of an input, friction that is "
        "another one backwards), and may be off by as much. Logs that drive the other way, too, would tell."
    )


def _moving(
    robot: Robot, logs: LogSet, velocities: list[dict[str, np.ndarray]], least: float
) -> tuple[State, np.ndarray]:
    """Some states in which the robot moves [N], a velocity more than the share `least` of its largest, and inputs [N, nu]
    there."""
    every = {name: np.concatenate([own[name] for own in velocities]) for name in velocities[0]}
    fast = sum(np.abs(v) / max(float(np.nanmax(np.abs(v))), 1e-300) for v in every.values())
    some = np.flatnonzero(np.isfinite(fast) & (fast > least * len(every)))
    some = some[np.unique(np.linspace(0, len(some) - 1, _STATES).astype(int))] if len(some) else some
    rest = {name: np.full(len(some), float(value)) for name, value in robot.initial_state().items()}
    inputs = np.concatenate([log.inputs for log in logs])[some]
    return {**rest, **{name: v[some] for name, v in every.items()}}, inputs


@in_float64
def _pushing_alike(fit: Fit, name: str, others: Sequence[str], state: State, inputs: np.ndarray) -> list[str]:
    """Those of the `others` that change the rates of the robot in these states in proportion to what the Coulomb friction
    `name` does."""
    robot, numbers = replace(fit.robot, effects=()), dict(fit.robot.parameters.numbers)

    def change(of: str) -> Float[np.ndarray, " N"]:
        step = _STEP * (abs(numbers[of]) or fit.robot.parameters[of].typical or 1.0)
        up, down = (
            np.asarray(
                rates_in_motion(robot, robot.velocities, state, tuple(inputs.T), {**numbers, of: numbers[of] + by})
            )
            for by in (step, -step)
        )
        return (up - down).ravel() / (2.0 * step)

    own = change(name)
    found = []
    for other in others:
        theirs = change(other)
        size = float(np.linalg.norm(own) * np.linalg.norm(theirs))
        if np.isfinite(size) and size > 0 and abs(float(own @ theirs)) > (1.0 - _ALIKE) * size:
            found.append(other)
    return found


def without_what_pushes_alike(fit: Fit, logs: LogSet, measured: bool = False) -> Fit:
    """The fit, of the motion as `measured` or as simulated, in which neither Coulomb friction of axes that turn one way only is
    identified nor a constant force that is free beside it, with a note: all that tells one from the other is where the robot
    just sticks, and that bounds them."""
    own = [name for name in fit.free_names if "." not in name and fit[name].status != "fixed"]
    told = [name for name in own if fit[name].status == "identified"]
    found, velocities = _of_one_way(fit, logs, own, measured) if told else ([], [])
    if not found:
        return fit
    state, inputs = _moving(fit.robot, logs, velocities, _BEYOND_NOISE if measured else 2.0 * _AGAINST)
    if not len(inputs):
        return fit
    table, parameters = fit.robot.parameters, dict(fit.parameters)
    notes = [note for note in fit.notes if not note.startswith(ONE_WAY)]
    before = len(notes)
    for name in found:
        alike = _pushing_alike(fit, name, [other for other in own if other != name], state, inputs)
        lost = [other for other in (name, *alike) if parameters[other].status == "identified"]
        if not alike or not lost:
            continue
        for other in lost:
            parameters[other] = replace(
                parameters[other],
                std_error=float("inf"),
                ci95=(table[other].lower, table[other].upper),
                status="not_identifiable",
            )
        notes.append(
            f"{ONE_WAY}: {' and '.join((name, *alike))} push alike all the time, and only what they make together is "
            "determined. Logs that drive the other way, too, would tell."
        )
    return replace(fit, parameters=parameters, notes=tuple(notes)) if len(notes) > before else fit
