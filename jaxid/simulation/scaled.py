"""A robot with the orders of magnitude of its logs, so that first guesses of effects do not depend on anybody's units."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .._float64 import in_float64
from ..logs import Log, LogSet
from ..parameters import ParameterError
from ..robots.closed_loop import at_commands
from ..robots.robot import Robot
from ..robots.scales import Scales, time_constant
from .reckoning import measured_states, measured_velocities, reckoned
from .simulate import simulate
from .start import initial_states

_FASTEST = 0.95
"""Quantile of a speed that counts as its largest."""
_HARDLY_EXCEEDED = 0.998
"""The same of what curves have to reach: logs that are faster than most have few samples and large forces."""


def _level(values: Sequence[NDArray[np.float64]], otherwise: float, quantile: float = _FASTEST) -> float:
    """What the magnitudes exceed in 5 % of the samples; `otherwise` where there is nothing to see."""
    pooled = np.abs(np.concatenate([v[np.isfinite(v)] for v in values])) if values else np.empty(0)
    found = float(np.quantile(pooled, quantile)) if pooled.size else 0.0
    return found if found > 0 else otherwise


@in_float64
def axis_map(robot: Robot, names: Sequence[str]) -> NDArray[np.float64]:
    """Matrix [velocities, drive axes] from the velocities to the drive axes' speeds at the rim, which are linear in them.

    The velocities themselves where a robot names no drive axes.
    """
    unit = np.eye(len(names))
    if not robot.drive_axes:
        return unit
    p, rest = robot.parameters.numbers, robot.initial_state()
    columns = []
    for i in range(len(names)):
        state = {**rest, **dict(zip(names, unit[i].tolist(), strict=True))}
        rims = robot.rim_speeds(robot.rubbing(state, p), p)
        columns.append([float(np.asarray(rims[k])) for k in robot.drive_axes])
    return np.array(columns)


def _rims(robot: Robot, speeds: list[dict[str, NDArray[np.float64]]]) -> list[NDArray[np.float64]]:
    """Speeds of the drive axes at the rim, one array a log."""
    names = list(speeds[0])
    to_axes = axis_map(robot, names)
    return [np.nan_to_num(np.stack([own[name] for name in names], axis=1)) @ to_axes for own in speeds]


@in_float64
def _efforts(robot: Robot, largest: float) -> tuple[float, float, float]:
    """Drive torque of a wheel, force at the ground, and friction that would hold a drive axis, at the largest input."""
    bare = replace(robot, effects=())
    # In NumPy, a parameter at its bound that something is divided by is no error.
    p = {name: np.float64(number) for name, number in bare.parameters.numbers.items()}
    rest = bare.initial_state()
    count = len(bare.channels.inputs)
    full = tuple(largest if i in bare.drive_inputs else 0.0 for i in range(count))
    torques = bare.drive_torques(full, rest, p)
    torque = max((abs(float(np.asarray(t))) for t in torques), default=0.0)
    forces = bare.drive_forces(torques, p) if torques else ()
    force = max((abs(float(np.asarray(f))) for f in forces), default=0.0)
    if not bare.drive_axes:
        return torque, force, 0.0
    axis = bare.drive_axes[0]
    none = (0.0,) * len(bare.rubbing(rest, p))

    def pulled(inputs: tuple[float, ...]) -> float:
        rates = {name: np.float64(rate) for name, rate in bare.rates(rest, inputs, none, p).items()}
        return float(np.asarray(bare.rubbing_rates({n: np.float64(v) for n, v in rest.items()}, rates, p)[axis]))

    with np.errstate(all="ignore"):
        idle = pulled((0.0,) * count)
        each = (pulled(tuple(u if i == j else 0.0 for i, u in enumerate(full))) - idle for j in range(count))
        own = float(np.asarray(bare.compliance(rest, p)[axis][axis]))
        friction = sum(map(abs, each)) / own if own > 0 else 0.0
    return torque, force, friction if np.isfinite(friction) else 0.0


def _unseen(robot: Robot, logs: LogSet, seen: Collection[str]) -> dict[str, float]:
    """Magnitudes of the velocities that nothing measures, as the robot at its parameters has them; none where it does not
    follow: the speeds of one part say nothing of those of another, in another unit."""
    names = tuple(name for name in robot.velocities if name in robot.own_states and name not in seen)
    showing = robot.showing(names) if names else None
    if showing is None:
        return {}
    still = (np.zeros((len(log), len(names))) for log in logs)
    asked = LogSet(
        [Log(log.name, log.time, log.inputs, own, showing.channels) for log, own in zip(logs, still, strict=True)]
    )
    try:
        start = {name: own for name, own in initial_states(robot, logs).states.items() if name in showing.states}
        moved = simulate(showing, asked, start=start)
    except ParameterError:
        return {}
    found = {name: _level([own[:, k] for own in moved], 0.0) for k, name in enumerate(names)}
    return {name: level for name, level in found.items() if 0.0 < level < np.inf}


def scales_of(robot: Robot, logs: LogSet) -> Scales:
    """Orders of magnitude of what `robot`, at its parameters, does in `logs`; in a closed loop, of its plant at the commands.

    Raises `LogError` for logs of a loop without commands.
    """
    if robot.controlled:
        return scales_of(robot.alone, at_commands(robot, logs))
    largest = max(float(np.max(np.abs(log.inputs[:, list(robot.drive_inputs)]))) for log in logs) or 1.0
    interval = float(np.median([log.sampling_interval for log in logs]))
    duration = float(np.median([log.duration for log in logs]))
    velocities = [measured_velocities(robot, log) for log in logs]
    seen = [{n: log.output(n) if n in log.measured else v.get(n, log.output(n)) for n in robot.channels.outputs}
            for log, v in zip(logs, velocities, strict=True)]  # fmt: skip
    measured = {n: _level([own[n] for own in seen], 0.0) for n in robot.channels.outputs}
    outputs = {name: level or max(measured.values()) or 1.0 for name, level in measured.items()}
    told = {name for own in velocities for name, values in own.items() if np.any(np.isfinite(values))}
    unseen = _unseen(robot, logs, {*outputs, *told})
    outputs = unseen | outputs
    farthest = {n: _level([own[n] for own in seen], outputs[n], _HARDLY_EXCEEDED) for n in measured}
    rims = [rim.ravel() for rim in _rims(robot, velocities)]
    usual = max(outputs.values())
    if unseen and not told:
        sizes = np.array([unseen.get(name, 0.0) for name in velocities[0]])
        usual = float(np.max(sizes @ np.abs(axis_map(robot, list(velocities[0]))), initial=0.0)) or usual
    speed = _level(rims, usual)
    time = time_constant(robot)
    time = min(max(time, 2.0 * interval), 0.1 * duration)
    torque, force, friction = _efforts(robot, largest)
    friction = friction or force or speed / time
    return Scales(
        input=largest,
        speed=speed,
        torque=torque or friction,
        force=force or friction,
        friction=friction,
        time=time,
        acceleration=speed / time,
        interval=interval,
        duration=duration,
        length=_length(robot, logs, velocities) or speed * time,
        angle=1.0 if robot.angle_unit == "rad" else (_length(robot, logs, velocities) or speed * time) / (2 * np.pi),
        outputs=outputs,
        inputs={
            name: max(float(np.max(np.abs(log.inputs[:, k]))) for log in logs) or 1.0
            for k, name in enumerate(robot.channels.inputs)
        },
        farthest=farthest,
        whole=_level(
            [_whole(robot, velocity | own) for velocity, own in zip(velocities, seen, strict=True)],
            0.0,
            _HARDLY_EXCEEDED,
        ),
        fastest=_level(rims, speed, _HARDLY_EXCEEDED),
        fastest_by_way={
            way: _level([np.maximum(sign * rim, 0.0) for rim in rims], 0.0, _HARDLY_EXCEEDED)
            for way, sign in zip(("forward", "backward"), (1.0, -1.0), strict=True)
        },
        way=_way(robot, logs, velocities),
    )


def _whole(robot: Robot, known: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """The size of the body's velocity in one log, of the translations that are known."""
    own = [known[name] for name in robot.translations if name in known]
    return np.sqrt(np.sum(np.square(own), axis=0)) if own else np.empty(0)


def _length(robot: Robot, logs: Sequence[Log], velocities) -> float:
    """The largest extent of a driven path; 0 for a robot of which it is not known."""
    extents = []
    for log, own in zip(logs, velocities, strict=True):
        known = measured_states(robot, log) | {name: np.nan_to_num(values) for name, values in own.items()}
        path = reckoned(robot, known, np.diff(log.time))[1]
        extents += [float(np.max(np.ptp(path, axis=0)))] if path is not None else []
    return max(extents, default=0.0)


def _way(robot: Robot, logs: Sequence[Log], velocities) -> tuple[float, float] | None:
    """From where to where the angle of a robot's one axis goes, as measured or summed up; None where it has no such way."""
    if len(robot.angles) != 1 or len(robot.drive_axes) != 1:
        return None
    every, p, rest, angle = [], robot.parameters.numbers, robot.initial_state(), robot.angles[0]
    for log, own in zip(logs, velocities, strict=True):
        known = measured_states(robot, log)
        if angle in known:
            every.append(known[angle])
            continue
        speeds = {name: np.nan_to_num(values) for name, values in own.items()}
        rate = next(
            (speeds[name] for name, place in robot.positions.items() if place == angle and name in speeds), None
        )
        if angle in robot.own_states and rate is None:
            return None
        if rate is None:
            still = {name: np.full(len(log), value) for name, value in rest.items()}
            rate = np.broadcast_to(np.asarray(robot.angle_rates({**still, **known, **speeds}, p)[0]), len(log))
        every.append(np.concatenate([[0.0], np.cumsum(np.diff(log.time) * rate[:-1])]))
    low, high = min(map(np.min, every)), max(map(np.max, every))
    return (float(low), float(high)) if high > low else None


def scaled_to(robot: Robot, logs: LogSet) -> Robot:
    """The robot with the scales of its logs; what its effects expect of their parameters follows them."""
    robot = replace(robot, scales=scales_of(robot, logs))
    table = robot.parameters
    for effect in robot.effects:
        for name, parameter in effect.parameters(robot).items():
            if name in table and parameter.typical is not None:
                table = table.change(name, typical=parameter.typical)
    return robot.with_parameters(table)
