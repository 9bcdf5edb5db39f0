"""Where a run starts: at rest at the origin, unless the log says otherwise.

Pose columns (x, y, theta, beta) in a log give those states, and the columns that an effect reads (a payload) its own. A log
whose first sample already moves (by more than a tenth of its largest speed), or shows another position than the origin, starts
from what it measured, and that, with the states nobody measures, is then uncertain. So is the speed that nobody measures where
a measured position changes from the first sample on; where a counter reads the same long enough, the robot stands, wherever
that is. So is, within its step, a position that a counter tells: whoever reads 0 may stand anywhere in a step, above it if the
counter rounds down, on either side if it rounds to the nearest. What is measured need be no state: from outputs that the robot
at rest would not show follow the nearest states that show them. What other values of the free parameters would make a robot at
rest show says nothing of motion (`rest`). Where the model knows of a sensor's bias or scale, it is taken off before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from .._arrays import array
from .._compile import compiled
from .._float64 import in_float64
from ..checks.motion import is_position
from ..logs import Log, LogSet
from ..logs.channels import POSE
from ..logs.noise import noise_level, sensor_step
from ..logs.windows import Windows, window_rows
from ..robots.effect import Numbers, State
from ..robots.robot import Robot
from ..robots.signal_path import overrides, passed
from .rest import explaining_rest
from .states_at_samples import first_slope, states_at_samples

_AT_REST = 5.0  # standard deviations of the first measurement
_MOVES, _BEGUN = 3.0, 0.7
"""Standard errors of a position's first slope, and share of its mean slope over the same samples, from which it moves: of a
robot that is driven from rest at once the first slope is a fifth of that."""
_STILL = 0.1
"""Share of a speed's largest value below which a first sample may as well be a sensor's offset on a robot at rest."""


_MANY_STEPS = 30
"""Steps that a counter goes through, somewhere in a log, in as long as it stands still at the start of a robot at rest."""
_FINE = 0.2
"""Step of a counter in units of the noise from which half of it is not lost among the noise."""
_MOST_ROBOTS = 64
_STEPS, _RANK = 8, 1e-8
"""Gauss-Newton steps from outputs to states, and the share of the largest slope below which one says nothing."""


@dataclass(frozen=True)
class InitialConditions:
    """Initial states of E logs: `states[name]` [E], and `uncertain` [E]: whether a log starts elsewhere, or was cut out of a
    longer one; `standing` [E]: whether its counters, which alone show the motion, say that it starts at rest."""

    states: dict[str, NDArray[np.float64]]
    uncertain: NDArray[np.bool_]
    standing: NDArray[np.bool_]


@partial(compiled, static_argnames=("sensors",))
def _after_sensors(sensors: Robot, numbers: Numbers, outputs: Float[Array, "T ny"]) -> Float[Array, "T ny"]:
    # The record ends where a log starts, at time zero: what drifts with the time is there as it is at the start.
    return passed(sensors, "measure", outputs, jnp.arange(1.0 - outputs.shape[0], 1.0), numbers)


@in_float64
def _sensed(robot: Robot, channels: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What the model's sensors make of a steady motion, by measured channel: offset and gain."""
    numbers = robot.parameters.numbers
    present = [
        effect
        for effect in robot.effects
        if overrides(type(effect), "measure") and any(numbers[name] for name in effect.parameters(robot))
    ]
    if not present:
        return np.zeros(channels), np.ones(channels)

    sensors = replace(robot, effects=tuple(present))

    arrays = {name: array(float(value)) for name, value in numbers.items()}

    def sensed(value: float) -> NDArray[np.float64]:
        return np.asarray(_after_sensors(sensors.structure, arrays, array(np.full((8, channels), value))))[-1]

    offset = sensed(0.0)
    gain = sensed(1.0) - offset
    return np.nan_to_num(offset), np.where(np.isfinite(gain) & (gain != 0), gain, 1.0)


def _observed(robot: Robot, state: Mapping[str, float], inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Outputs [channels.outputs] of a state; optional ones, which `observe` gives after them, are left out."""
    seen = robot.observe(dict(state), tuple(inputs), robot.parameters.numbers)
    return np.array([float(y) for y in seen[: len(robot.channels.outputs)]])


@in_float64
def _showing(
    robot: Robot, state: Mapping[str, float], inputs: NDArray[np.float64], wanted: NDArray[np.float64]
) -> dict[str, float]:
    """The state near the given one whose outputs are those `wanted` [channels.outputs] where they are finite."""
    names, known = robot.estimated_states, np.isfinite(wanted)
    numbers = robot.parameters.numbers

    def outputs(x):
        seen = robot.observe({**state, **dict(zip(names, x, strict=True))}, tuple(inputs), numbers)
        return jnp.stack([jnp.asarray(y, float) for y in seen[: len(wanted)]])

    x = np.array([float(state[name]) for name in names])
    for _ in range(_STEPS):
        error = np.where(known, wanted - np.asarray(outputs(x)), 0.0)
        slopes = np.where(known[:, None], np.asarray(jax.jacfwd(outputs)(x)), 0.0)
        if not (np.isfinite(error).all() and np.isfinite(slopes).all()):
            return dict(state)
        x = x + np.linalg.pinv(slopes, rcond=_RANK) @ error
    return {**state, **dict(zip(names, x.tolist(), strict=True))} if np.isfinite(x).all() else dict(state)


def _of_velocities(robot: Robot, log: Log) -> set[str]:
    """The outputs that are no states and show a velocity, as the robot at rest has them; all of them where it names none."""
    others = {*log.channels.outputs} - {*robot.states}
    if not others or not any(name in robot.states for name in robot.velocities):
        return others
    # A first look begins every candidate's model; what is observed of a motion is the robot's own.
    bare = replace(robot, effects=())
    return others & _showing_speeds(bare.structure, tuple(sorted(bare.parameters.numbers.items())))


@lru_cache(_MOST_ROBOTS)
@in_float64
def _showing_speeds(robot: Robot, numbers: tuple[tuple[str, float], ...]) -> frozenset[str]:
    """The outputs that another velocity changes, of the robot at rest with these parameters and without a command."""
    rest = dict.fromkeys(robot.states, 0.0) | robot.initial_state()
    moving = [name for name in robot.velocities if name in robot.states]
    idle, p = (0.0,) * len(robot.channels.inputs), dict(numbers)

    def outputs(speeds):
        seen = robot.observe({**rest, **dict(zip(moving, speeds, strict=True))}, idle, p)
        return jnp.stack([jnp.asarray(y, float) for y in seen[: len(robot.channels.outputs)]])

    slopes = np.asarray(jax.jacfwd(outputs)(jnp.zeros(len(moving))))
    shows = np.any(slopes != 0.0, axis=1) | ~np.all(np.isfinite(slopes), axis=1)
    return frozenset(name for name, ok in zip(robot.channels.outputs, shows, strict=True) if ok)


def counted(robot: Robot, logs: LogSet) -> NDArray[np.bool_]:
    """Which measured positions are counted in steps that the noise does not hide, so that their start is known to a step only
    [E, estimated states]."""
    noise = noise_level(logs)
    found = np.zeros((len(logs), len(robot.estimated_states)), dtype=bool)
    for name in set(robot.positions.values()) & set(robot.estimated_states) & set(logs[0].channels.measured):
        level = noise[name] if np.isfinite(noise[name]) else np.inf
        for e, log in enumerate(logs):
            found[e, robot.estimated_states.index(name)] = sensor_step(log.output(name)) > _FINE * level
    return found


def states_at(robot: Robot, log: Log, at: NDArray[np.int64]) -> dict[str, Float[NDArray, " W"]]:
    """The likeliest states [W] by name at the samples `at` [W] of a log."""
    begin = _by_first_samples(robot, LogSet([log])).states
    return states_at_samples(robot, log, at, {name: float(value[0]) for name, value in begin.items()})


def initial_states(robot: Robot, logs: LogSet) -> InitialConditions:
    """The initial states that the logs' own columns and first samples suggest; of windows, those that the logs from which they
    were cut tell there."""
    if not isinstance(logs, Windows):
        return _by_first_samples(robot, logs)
    found = _by_first_samples(robot, logs, [not log.cut for log in logs])
    parts = [states_at(robot, log, np.array([k.start for k in window_rows(log, logs.seconds)])) for log in logs.whole]
    there = {name: np.concatenate([part[name] for part in parts]) for name in robot.states}
    cut = np.array([log.cut for log in logs])
    return replace(found, states={name: np.where(cut, there[name], own) for name, own in found.states.items()})


def _first(log: Log, column: str) -> float:
    """The first value in one of the further columns of a log; not a number where there is none."""
    if column not in log.extra.columns:
        return np.nan
    try:
        return float(log.extra[column].iloc[0])
    except (TypeError, ValueError):
        return np.nan


def _by_first_samples(robot: Robot, logs: LogSet, asked: Sequence[bool] | None = None) -> InitialConditions:
    """The initial states by every log's first sample, or by that of the logs `asked` [E]; of the others only whether they are
    uncertain."""
    noise = noise_level(logs)
    default = robot.initial_state()
    states = {name: np.full(len(logs), default[name]) for name in robot.states}
    uncertain = np.array([log.cut for log in logs], dtype=bool)
    measured, outputs = logs[0].channels.measured, robot.channels.outputs
    offset, gain = _sensed(robot, len(measured))
    told = {name: name for name in POSE if name in robot.states}
    told |= {effect.own(name): name for effect in robot.effects for name in effect.from_columns}
    for e, log in enumerate(logs):
        for state, column in told.items():
            value = _first(log, column)
            if np.isfinite(value):
                states[state][e] = value
    values = np.stack([(log.outputs[0] - offset) / gain for log in logs])
    # Started elsewhere than at rest at the origin: by the first sample, which is as wrong as its noise.
    level = np.array([noise[name] if np.isfinite(noise[name]) else 0.0 for name in measured])
    largest = np.array([np.nanmax(np.abs(log.outputs), axis=0, initial=0.0) for log in logs])
    # What is no velocity and no output of any, such as a temperature, has no rest that a small offset could be one of.
    resting = _of_velocities(robot, logs[0]) | {*robot.velocities}
    largest[:, [name not in logs[0].channels.outputs or name not in resting for name in measured]] = 0.0
    least = np.maximum(_AT_REST * level, _STILL * largest)
    known = [i for i, name in enumerate(outputs) if name not in states]
    places = [e for e in range(len(logs)) if asked is None or asked[e]]
    rest = np.full((len(logs), len(outputs)), np.nan)
    if known and places:
        standing = [{name: float(own[e]) for name, own in states.items()} for e in places]
        begun = LogSet([logs[e] for e in places])
        parts = (values[places, : len(outputs)], least[places, : len(outputs)])
        robot, rest[places] = _at_rest(robot, begun, standing, *parts, known)
    for e in places:
        elsewhere = False
        for index, channel in enumerate(measured):
            value = float(values[e, index])
            if not np.isfinite(value) or (channel not in states and index not in known):
                continue
            # Nothing depends on where a wheel was when its counter was set to zero.
            if channel in robot.measured_angles:
                states[channel][e] = value
                continue
            usual = default[channel] if channel in states else rest[e, index]
            if not (abs(value - usual) > least[e, index] and abs(value) > 0):
                continue
            uncertain[e] = True
            if channel in states:
                states[channel][e] = value
            else:
                elsewhere = True
        if elsewhere:
            first = np.full(len(outputs), np.nan)
            first[known] = values[e, known]
            begin = {name: float(own[e]) for name, own in states.items()}
            for name, value in _showing(robot, begin, logs[e].inputs[0], first).items():
                states[name][e] = value
        elif _unseen(robot, logs[e]):
            uncertain[e] = uncertain[e] or _positions_move(logs[e], noise)
            if uncertain[e]:
                begin = {name: float(own[e]) for name, own in states.items()}
                there = states_at_samples(robot, logs[e], np.zeros(1, np.int64), begin)
                for name in _unseen(robot, logs[e]):
                    states[name][e] = float(there[name][0])
    standing = np.array([_stands(robot, log) for log in logs])
    for e in np.flatnonzero(standing):
        for name in _unseen(robot, logs[int(e)]):
            states[name][e] = default[name]
    return InitialConditions(states, uncertain, standing)


def _unseen(robot: Robot, log: Log) -> tuple[str, ...]:
    """The velocities that show in nothing that a log measures but positions."""
    shown = log.measured
    seen = any(name not in robot.states and not is_position(log, name) for name in shown)
    return () if seen else tuple(name for name in robot.velocities if name in robot.states and name not in shown)


def _stands(robot: Robot, log: Log) -> bool:
    """Whether the log begins with counters that read the same while they go through many steps in as long elsewhere: what they
    read again says nothing to a fit, and a motion there would be free."""
    unseen = not log.cut and bool(_unseen(robot, log))
    counted = [log.output(name) for name in log.measured if unseen and is_position(log, name)]
    for read in counted:
        step, changed = sensor_step(read), np.flatnonzero(read != read[0])
        samples = int(changed[0]) if len(changed) else 0
        if not step or samples < 2 or not _MANY_STEPS * step <= np.nanmax(np.abs(read[samples:] - read[:-samples])):
            return False
    return bool(counted)


def _positions_move(log: Log, noise: Mapping[str, float]) -> bool:
    """Whether any measured position moves at its first sample already, and does not just begin to."""
    for name in log.measured:
        if is_position(log, name):
            slope, error, mean = first_slope(log.time, log.output(name), noise[name])
            if abs(slope) > _MOVES * error and abs(slope) > _BEGUN * abs(mean):
                return True
    return False


def _at_rest(
    robot: Robot,
    logs: LogSet,
    states: Sequence[State],
    values: NDArray[np.float64],
    least: NDArray[np.float64],
    known: Sequence[int],
) -> tuple[Robot, NDArray[np.float64]]:
    """What the robot in these `states` shows of the outputs at the places `known` [E, ny], and the robot that shows it: where
    its own numbers do not explain the first `values`, with those that do."""

    def shown(by: Robot) -> NDArray[np.float64]:
        found = np.full(values.shape, np.nan)
        seen = np.stack([_observed(by, state, log.inputs[0]) for state, log in zip(states, logs, strict=True)])
        found[:, known] = seen[:, known]
        return found

    found = shown(robot)
    if np.any(np.abs(values - found) > least):
        first = np.full(values.shape, np.nan)
        first[:, known] = values[:, known]
        robot = explaining_rest(robot, states, np.stack([log.inputs[0] for log in logs]), first, least)
        found = shown(robot)
    return robot, found


def free_states(robot: Robot, logs: LogSet, begin: InitialConditions) -> NDArray[np.bool_]:
    """Which of the states that can be estimated are to be [E, estimated states]: all of a log that starts elsewhere (but the
    speeds that nobody measures where it stands), positions that a counter tells, and wheels' angles, whose zero
    is arbitrary."""
    turned = np.isin(robot.estimated_states, robot.measured_angles)
    there = np.array([[name in log.measured for name in robot.estimated_states] for log in logs])
    resting = np.isin(robot.estimated_states, robot.velocities) & ~there & begin.standing[:, None]
    return begin.uncertain[:, None] & (there | ~turned) & ~resting | turned & there | counted(robot, logs)
