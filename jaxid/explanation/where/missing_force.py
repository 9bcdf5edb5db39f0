"""The force that a model misses, over time: what would have to push the robot for the model to follow the log.

Every equation of motion gets an unknown generalised force that wanders like a random walk. A Kalman filter and a
Rauch-Tung-Striebel smoother estimate it together with the robot's state from the measured outputs; the filter's
likelihood says how strongly each force wanders. No parameter is changed, so a model that lacks nothing needs no force.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ..._arrays import array
from ..._compile import compiled
from ..._float64 import in_float64
from ...kernel.machine import lanes
from ...logs import Log, LogSet, noise_scale
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.robot import Robot
from ...robots.scales import Scales
from ...simulation.rollout import Integrator, rollout
from ...simulation.scaled import scales_of
from ...simulation.simulate import integrator_for
from ...simulation.start import InitialConditions, initial_states, states_at
from .force_filter import PREFIX, Setting, filtered, likelihoods
from .force_filter_directly import filtered_directly, smoothed

_MULTIPLE = 8
"""Logs are filled up to a multiple of so many."""
_INTENSITIES = tuple(
    float(np.sqrt(0.1)) * level for level in (0.002, 0.006, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
)
"""Random-walk intensities that are tried, in units of `ForceHistory.scale` per root of its response time."""
_BEGUN = 200.0
"""Samples for which a force has wandered when a log begins."""
_RESPONSE = 5.0
"""Response time in sampling intervals."""
_FIRST = 9
"""Place in `_INTENSITIES` of the first filter: strong, so that its points reach beyond break-away."""
_ROUNDS = 2
_MODEL_ERROR = 0.02
"""Error of one sample's integration in units of the noise; it also keeps covariances regular at standstill."""
_UNSEEN_ERROR, _AT_REST = 1e-6, 1e-3
"""The same of a state that no sensor shows, and its standard deviation where a log starts at rest, in units of its size."""
_LEAST_NOISE = 1e-4
"""The least noise of a channel, in units of its largest value."""
_STATES = 100
"""Samples of a log from which the sizes of its states are taken."""
_TAIL, _FAR = 0.1, 2.0
"""Share of these samples on either side of the middle ones, and in ranges of those how far off a state may be."""


class NoVelocities(ValueError):
    """The robot does not say which states its forces accelerate; the message says how to tell."""


@dataclass(frozen=True)
class MissingForce(Effect):
    """One unknown generalised force for each of `velocities`, a state that keeps its value between samples."""

    velocities: tuple[str, ...] = ()

    id: ClassVar[str] = "missing_force"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "Q' = Q + missing force"

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return tuple(PREFIX + name for name in self.velocities)

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        return tuple(f + state[name] for f, name in zip(forces, self.states_on(robot), strict=True))

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        return {name: 0.0 * state[name] for name in self.states_on(robot)}


@dataclass(frozen=True)
class ForceHistory:
    """The missing force of one log.

    - `log`: the log's name; `time` [T] s.
    - `force`, `std` [T, n]: estimate and standard deviation, one column for each of `names` (the velocities that the
      forces accelerate) in `units`.
    - `scale` [n]: the force that changes its speed by one standard deviation of the noise within the response time of
      five samples, in which forces of different units compare.
    - `intensity` [n]: how far each force wanders per root of the logs' unit of time (seconds), chosen by likelihood.
    """

    log: str
    time: NDArray[np.float64]
    force: NDArray[np.float64]
    std: NDArray[np.float64]
    names: tuple[str, ...]
    units: tuple[str, ...]
    scale: NDArray[np.float64]
    intensity: NDArray[np.float64]


def forced(robot: Robot) -> tuple[Robot, tuple[str, ...], tuple[str, ...]]:
    """The robot with its missing forces as states; the velocities they belong to, and the forces' units.

    A robot whose equations do not say what a force accelerates gets missing accelerations of its `velocities`. Raises
    `NoVelocities` where there are none.
    """
    if not robot.velocities:
        raise NoVelocities(
            f"the robot {robot.name!r} does not say which of its states forces accelerate; declare "
            "`velocities = (state names)`"
        )
    if "force" not in robot.traits:
        robot = robot.per_unit_inertia()
        of = tuple(f"{unit}/s" if (unit := robot.velocity_unit(name)) else "1/s" for name in robot.velocities)
    else:
        of = tuple(map(robot.force_unit, robot.velocities))
    return robot + MissingForce(robot.velocities), robot.velocities, of


# -- the filter over all logs -------------------------------------------------------------------------------------
@partial(compiled, static_argnames="setting")
def _mobility(setting: Setting, numbers, start: State):
    """Acceleration of each velocity per unit of its own force [n], all else apart."""
    robot = setting.robot
    idle = tuple(0.0 for _ in robot.channels.inputs)
    loose = tuple(0.0 for _ in robot.rubbing(start, numbers))
    found = []
    for name in setting.velocities:
        push = {key: jnp.full((), float(key == PREFIX + name)) for key in start}
        found.append(jax.jvp(lambda s: robot.rates(s, idle, loose, numbers), (start,), (push,))[1][name])
    return jnp.stack(found)


def _force_scale(setting: Setting, numbers, start: State, noise: Mapping[str, float], response: float):
    """Forces [n] that change their own speed by one standard deviation of the noise within the response time.

    `noise` holds every velocity."""
    mobility = np.abs(np.asarray(_mobility(setting, numbers, start)))
    mobility = np.where(mobility > 0, mobility, np.max(mobility, initial=np.finfo(float).tiny))
    return np.array([noise[name] for name in setting.velocities]) / response / mobility


def _sizes(robot: Robot, logs: LogSet, scales: Scales) -> dict[str, float]:
    """How much each state of `robot` varies in the logs; of one that nothing tells, its order of magnitude."""
    found = dict.fromkeys(robot.states, 1.0)
    found |= {name: scales.angle for name in robot.angles if name in found}
    found |= {name: scales.length for name in ("x", "y") if name in found}
    parts: dict[str, list[NDArray[np.float64]]] = {}
    for log in logs:
        at = np.unique(np.linspace(0, len(log) - 1, _STATES).astype(int))
        for name, values in states_at(robot, log, at).items():
            parts.setdefault(name, []).append(values)
    for name in robot.estimated_states:
        spread = _spread(np.concatenate(parts[name]))
        found[name] = spread if spread > 0 else found[name]
    return found


def _spread(values: NDArray[np.float64]) -> float:
    """Standard deviation of a state, no value being taken for farther off than `_FAR` times the range of the middle ones: what
    outputs hardly show at some samples (a steering angle at standstill) can be anything there."""
    low, high = np.quantile(values, (_TAIL, 1.0 - _TAIL))
    if not low < high:
        return float(np.std(values))
    return float(np.std(np.clip(values, low - _FAR * (high - low), high + _FAR * (high - low))))


@partial(compiled, static_argnames=("robot", "integrator"))
def _sensed(robot: Robot, integrator: Integrator, numbers, start, inputs, dt):
    """What the measurement stages of the model's own effects add to its simulated outputs."""
    plain = replace(robot, effects=tuple(e for e in robot.effects if type(e).measure is Effect.measure))

    def one(s, u, d):
        bare = {name: s[name] for name in plain.states}
        return rollout(robot, numbers, s, u, d, integrator) - rollout(plain, numbers, bare, u, d, integrator)

    return jax.vmap(one)(start, inputs, dt)


def _begin(robot: Robot, logs: LogSet, known: Mapping[str, Mapping[str, float]]) -> InitialConditions:
    """Initial states, those that were estimated put in."""
    begin = initial_states(robot, logs)
    states = {name: np.array(value) for name, value in begin.states.items()}
    for e, log in enumerate(logs):
        for name, value in known.get(log.name, {}).items():
            if name in states:
                states[name][e] = value
    return replace(begin, states=states)


def _arrays(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float],
    begin: InitialConditions,
    numbers,
    integrator: Integrator,
    sizes: Mapping[str, float],
):
    """Everything the filter reads of each log, [E, ...]."""
    batch, states = logs.batch(), begin.states
    channels = logs.channels
    used = [c for c in channels.measured if c in channels.outputs or c in robot.states]
    levels = np.array([noise.get(c, np.nan) for c in used])
    columns = [channels.measured.index(c) for c in used]
    by_state = np.array([noise.get(name, np.nan) for name in robot.states])
    seen = np.isfinite(by_state)
    size = np.array([sizes[name] for name in robot.states])
    spread = np.where(seen, by_state, _AT_REST * size)[None, :] * np.ones((len(logs), 1))
    estimated = np.array([name in robot.estimated_states for name in robot.states])
    spread = np.where(begin.uncertain[:, None] & estimated & ~seen, size, spread)
    outputs = batch.outputs
    if any(type(effect).measure is not Effect.measure for effect in robot.effects):
        start = {name: jnp.asarray(value) for name, value in states.items()}
        outputs = outputs - _sensed(robot.structure, integrator, numbers, start, batch.inputs, batch.dt)
    lanes = np.ones((len(logs), 1))
    begun = _BEGUN * float(np.median([log.sampling_interval for log in logs]))
    return {
        "begun": array(np.full(len(logs), np.sqrt(begun))),
        "inputs": batch.inputs,
        "dt": batch.dt,
        "outputs": outputs[..., : max(columns) + 1],
        "there": array(
            (np.asarray(batch.mask) & np.array([c in used for c in channels.measured]))[..., : max(columns) + 1]
        ),
        "start": array(np.stack([states[name] for name in robot.states], axis=-1)),
        "spread": array(spread),
        "noise": array(lanes * np.interp(range(max(columns) + 1), columns, np.nan_to_num(levels, nan=1.0))),
        "jitter": array(lanes * np.where(seen, _MODEL_ERROR * by_state, _UNSEEN_ERROR * size) ** 2),
    }


def _filled_up(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """The same with logs of which nothing was measured, up to a multiple: other numbers of logs share a compiled program."""
    more = -len(arrays["dt"]) % max(_MULTIPLE, lanes())
    filled = {name: np.concatenate([x, np.repeat(np.asarray(x)[-1:], more, axis=0)]) for name, x in arrays.items()}
    filled["there"][len(filled["there"]) - more :] = False
    return {name: array(values) for name, values in filled.items()}


def _moments(setting: Setting, numbers, arrays, intensity):
    """The filter's moments of every log, by machine code or as a compiled program."""
    found = filtered_directly(setting, numbers, arrays, intensity)
    return filtered(setting, numbers, arrays, intensity) if found is None else found


def _chosen(setting: Setting, numbers, arrays, scale):
    """Random-walk intensities of highest likelihood among `_INTENSITIES` times `scale` [n], and the filter's moments there.

    A filter at strong intensities is linearised where it went; in that linear model many intensities are tried at
    once, one force at a time, twice round. A second filter at the best of them repeats this.
    """
    n, levels = len(scale), np.array(_INTENSITIES)
    choice = np.full(n, _FIRST)
    for _ in range(_ROUNDS):
        used = array(levels[choice] * scale)
        kept, linearised = _moments(setting, numbers, arrays, used), choice
        for _ in range(2 if n > 1 else 1):
            lanes = np.array([np.where(np.arange(n) == j, level, levels[choice]) for j in range(n) for level in levels])
            found = np.asarray(likelihoods(setting, arrays, kept, used, array(lanes * scale)))
            found = np.where(np.isfinite(found), found, -np.inf).reshape(n, len(levels))
            choice = np.argmax(found, axis=1)
        if np.array_equal(choice, linearised):
            return np.asarray(used), kept
    used = array(levels[choice] * scale)
    return np.asarray(used), _moments(setting, numbers, arrays, used)


class _Task(NamedTuple):
    """What the filter needs of a robot and its logs; `scale` [n] as in `ForceHistory`, `response` the time of that."""

    setting: Setting
    units: tuple[str, ...]
    numbers: Mapping[str, Any]
    arrays: dict[str, Any]
    scale: NDArray[np.float64]
    response: float

    def intensity(self, wander: float) -> NDArray[np.float64]:
        """Random-walk intensities [n] of forces that wander by `wander` times `scale` in a response time."""
        return wander * self.scale / np.sqrt(self.response)


def _farthest(log: Log, channel: str, robot: Robot) -> float:
    """The largest value of a channel; of a wheel's angle, whose zero is arbitrary, the farthest from where it began."""
    values = log.output(channel)
    zero = values[np.isfinite(values)][0] if channel in robot.measured_angles else 0.0
    return float(np.nanmax(np.abs(values - zero)))


def _task(robot: Robot, logs: LogSet, noise, known_states) -> _Task:
    pushed, names, units = forced(robot)
    noise = dict(noise or noise_scale(logs))
    # Of a channel that no log holds, nothing is known: its state is as uncertain as one that has no sensor.
    shown = sorted({c for log in logs for c in log.measured})
    largest = {c: max(_farthest(log, c, robot) for log in logs if c in log.measured) for c in shown}
    noise = {c: max(noise[c], _LEAST_NOISE * largest[c]) for c in shown if np.isfinite(noise.get(c, np.nan))}
    numbers = {name: array(float(value)) for name, value in pushed.parameters.numbers.items()}
    integrator = integrator_for(robot, logs)
    scales = scales_of(robot, logs)
    sizes = _sizes(robot, logs, scales)
    # A velocity that no sensor of its own shows is as uncertain, in units of its size, as what is measured is.
    amplitude = {c: float(np.nanstd(np.concatenate([log.output(c) for log in logs]))) for c in noise}
    usual = float(np.median([noise[c] / size for c, size in amplitude.items() if size > 0] or [1e-2]))
    of_speeds = {name: noise.get(name, usual * sizes[name]) for name in names}
    setting = Setting(pushed.structure, integrator, names)
    response = _RESPONSE * scales.interval
    begin = _begin(pushed, logs, known_states or {})
    start = {name: begin.states[name][0] for name in pushed.states}
    scale = _force_scale(setting, numbers, start, of_speeds, response)
    # Forces are as large as their scale says, in whatever unit: one newton is nothing or all there is.
    sizes |= {PREFIX + name: float(size) for name, size in zip(names, scale, strict=True)}
    arrays = _filled_up(_arrays(pushed, logs, noise, begin, numbers, integrator, sizes))
    return _Task(setting, units, numbers, arrays, scale, response)


@in_float64
def missing_force(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float] | None = None,
    known_states: Mapping[str, Mapping[str, float]] | None = None,
    intensity: NDArray[np.float64] | None = None,
) -> tuple[ForceHistory, ...]:
    """The missing generalised forces of `robot` (fitted, with its effects) over time, one `ForceHistory` for each log.

    `noise` is the measurement noise by channel (default: what the data say), `known_states` estimated initial states by
    log name, `intensity` how far each force wanders (`ForceHistory.intensity`; by default, what is likeliest).
    Effects on commands act as in a rollout, states of effects are part of the state. Effects on measurements
    are accounted for by what they change in the model's own simulation: exactly for an offset, to first order otherwise.
    While model and robot stand still a force below break-away shows nowhere, and its standard deviation grows.

    Raises `NoVelocities` for a robot that does not say which states its forces accelerate.
    """
    task = _task(robot, logs, noise, known_states)
    if intensity is None:
        intensity, kept = _chosen(task.setting, task.numbers, task.arrays, task.intensity(1.0))
    else:
        kept = _moments(task.setting, task.numbers, task.arrays, array(intensity))
    mean, std = smoothed(kept)
    names = task.setting.velocities
    columns = [task.setting.robot.states.index(PREFIX + name) for name in names]
    return tuple(
        ForceHistory(
            log.name, log.time, mean[e, : len(log)][:, columns], std[e, : len(log)][:, columns],
            names, task.units, task.scale, intensity,
        )
        for e, log in enumerate(logs)
    )  # fmt: skip


class Smoothed(NamedTuple):
    """A state's mean and standard deviation [E, T], padded as in `logs.batch()`."""

    mean: Float[np.ndarray, "E T"]
    std: Float[np.ndarray, "E T"]


@in_float64
def smoothed_states(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float] | None = None,
    known_states: Mapping[str, Mapping[str, float]] | None = None,
    wander: float = 1.0,
) -> dict[str, Smoothed]:
    """The robot's states over time by name, the missing forces among them (`PREFIX` and a velocity): what model and
    measurements say together.

    `wander` is how far the missing forces may, in units of `ForceHistory.scale` per root of its response time: little
    trusts the model, much the measurements. Other arguments, and errors, as in `missing_force`.
    """
    task = _task(robot, logs, noise, known_states)
    kept = _moments(task.setting, task.numbers, task.arrays, array(task.intensity(wander)))
    mean, std = (x[: len(logs)] for x in smoothed(kept))
    return {name: Smoothed(mean[..., i], std[..., i]) for i, name in enumerate(task.setting.robot.states)}
