"""The force that a model misses, over time: what would have to push the robot for the model to follow the log.

Every equation of motion gets an unknown generalised force that wanders like a random walk. A Kalman filter and a
Rauch-Tung-Striebel smoother estimate it together with the robot's state from the measured outputs; the filter's
likelihood says how strongly each force wanders. No parameter is changed, so a model that lacks nothing needs no force.

The moments are carried through the rollout's own steps at cubature points (Arasaratnam & Haykin, Cubature Kalman
filters, IEEE Trans. Automatic Control 54, 2009; smoother: Sarkka, Unscented Rauch-Tung-Striebel smoother, ibid. 53,
2008), not by derivatives. A model that sticks has a derivative of zero with respect to the force: an extended filter
would stay blind when the real robot moves and the model does not. The points spread as far as the force is uncertain,
so that they reach beyond break-away once that is possible.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from .._float64 import in_float64
from ..logs import LogSet, noise_level
from ..robots.custom import Custom
from ..robots.effect import Effect, Numbers, Path, State
from ..robots.robot import Robot
from ..simulate.rollout import Integrator, rollout, step
from ..simulate.simulate import integrator_for
from ..simulate.start import initial_states

_PREFIX = "missing_force."
_INTENSITIES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
"""Random-walk intensities that are tried, in units of `ForceHistory.scale` per root of a second."""
_FIRST = 7
_ROUNDS = 2
_START = 2.0
"""Standard deviation of a force at the start, in units of what it wanders in one second."""
_RESPONSE = 0.1
"""Time [s] in which a force of `scale` changes its speed by one standard deviation of the noise."""
_MODEL_ERROR = 0.02
"""Error of one sample's integration in units of the noise; it also keeps covariances regular at standstill."""
_UNSEEN_SPREAD = 0.5
"""Standard deviation (SI units) of an initial state that no sensor shows, where a log starts in motion."""


class NoVelocities(ValueError):
    """The robot does not say which states its forces accelerate; the message says how to tell."""


@dataclass(frozen=True)
class MissingForce(Effect):
    """One unknown generalised force for each of `velocities`, a state that keeps its value between samples."""

    velocities: tuple[str, ...] = ()

    id: ClassVar[str] = "missing_force"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "Q' = Q + missing force"

    @property
    def states(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(_PREFIX + name for name in self.velocities)

    def force(self, forces: Path, state: State, p: Numbers) -> Path:
        return tuple(f + state[name] for f, name in zip(forces, self.states, strict=True))

    def rates(self, state: State, currents: Path, p: Numbers) -> State:
        return {name: 0.0 * state[name] for name in self.states}


@dataclass(frozen=True)
class _Accelerated:
    """A user's dynamics with a missing acceleration added to the rates of `velocities`."""

    dynamics: Callable[..., Mapping[str, Any]]
    velocities: tuple[str, ...]

    def __call__(self, state: State, *others: Any) -> State:
        rates = dict(self.dynamics({k: v for k, v in state.items() if not k.startswith(_PREFIX)}, *others))
        missing = {_PREFIX + name: state[_PREFIX + name] for name in self.velocities}
        rates |= {name: rates[name] + missing[_PREFIX + name] for name in self.velocities}
        return rates | {name: 0.0 * value for name, value in missing.items()}


@dataclass(frozen=True)
class ForceHistory:
    """The missing force of one log.

    - `log`: the log's name; `time` [T] s.
    - `force`, `std` [T, n]: estimate and standard deviation, one column for each of `names` (the velocities that the
      forces accelerate) in `units`.
    - `scale` [n]: the force that changes its speed by one standard deviation of the noise within 0.1 s, in which forces
      of different units compare.
    - `intensity` [n]: how far each force wanders in one second, chosen by likelihood.
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

    A `Custom` robot, whose equations are not split into forces, gets missing accelerations of its `velocities`, or,
    where it names none, of those outputs that are states. Raises `NoVelocities` where there are none.
    """
    units = robot.channels.units
    if isinstance(robot, Custom):
        names = robot.velocities or tuple(n for n in robot.channels.outputs if n in robot.state_names)
        _needed(robot, names)
        states = (*robot.state_names, *(_PREFIX + name for name in names))
        changed = replace(robot, dynamics=_Accelerated(robot.dynamics, names), state_names=states)
        return changed, names, tuple(f"{units[name]}/s" if units.get(name) else "1/s" for name in names)
    names = robot.velocities
    _needed(robot, names)
    angular = [units.get(name, "").startswith("rad") for name in names]
    return robot + MissingForce(names), names, tuple("N m" if turns else "N" for turns in angular)


def _needed(robot: Robot, names: tuple[str, ...]) -> None:
    if not names:
        raise NoVelocities(
            f"the robot {robot.name!r} does not say which of its states forces accelerate; give its class "
            "`velocities = (state names)`"
        )


# -- filter and smoother of one log ---------------------------------------------------------------------------------
def _points(mean, covariance):
    """Cubature points [2n, n] of a Gaussian."""
    n = mean.shape[0]
    spread = jnp.sqrt(float(n)) * jnp.linalg.cholesky(covariance).T
    return jnp.concatenate([mean + spread, mean - spread])


def _symmetric(matrix):
    return 0.5 * (matrix + matrix.T)


def _commanded(robot: Robot, inputs, dt, substeps: int, p: Numbers):
    """Inputs of every step of the integrator [T, substeps, nu], after the effects on whole commands."""
    fine_dt = jnp.repeat(dt / substeps, substeps)
    time = jnp.concatenate([jnp.zeros(1), jnp.cumsum(fine_dt)[:-1]])
    fine = jnp.repeat(inputs, substeps, axis=0)
    for effect in robot.effects:
        fine = effect.command(fine, time, fine_dt, p)
    return fine.reshape(len(dt), substeps, -1)


@dataclass(frozen=True)
class _Setting:
    """What a compiled filter depends on."""

    robot: Robot
    integrator: Integrator
    velocities: tuple[str, ...]


def _filter(setting: _Setting, p: Numbers, log, intensity):
    """Forward pass over one log at cubature points: for every sample what the smoother and a linear filter need.

    Mean and covariance after the measurement; the next sample's before its measurement; their cross-covariance; the
    expected outputs and their slope, and the mean at which these were taken.
    """
    robot, integrator = setting.robot, setting.integrator
    names = robot.states
    outputs = log["outputs"].shape[1]

    def as_state(vector) -> State:
        return {name: vector[i] for i, name in enumerate(names)}

    def advance(vector, volts, interval):
        def substep(state, held):
            return step(robot, state, tuple(held), interval / integrator.substeps, p, integrator.friction), None

        state, _ = jax.lax.scan(substep, as_state(vector), volts)
        return jnp.stack([state[name] for name in names])

    def observe(vector, seen):
        return jnp.stack([jnp.asarray(y, float) for y in robot.observe(as_state(vector), tuple(seen), p)])[:outputs]

    def sample(carry, row):
        predicted, covariance = carry
        volts, y, there, interval = row
        expected, slope = observe(predicted, volts[0]), jax.jacfwd(observe)(predicted, volts[0])
        mean, covariance, _ = _measured(predicted, covariance, expected, slope, y, there, log["noise"])
        points = _points(mean, covariance + jnp.diag(log["jitter"]))
        ahead = jax.vmap(lambda point: advance(point, volts, interval))(points)
        after = jnp.mean(ahead, axis=0)
        spread, before = ahead - after, points - mean
        covariance_after = spread.T @ spread / len(points) + _walked(setting, intensity, interval, log)
        cross = before.T @ spread / len(points)
        return (after, covariance_after), (mean, covariance, after, covariance_after, cross, expected, slope, predicted)

    volts = _commanded(robot, log["inputs"], log["dt"], integrator.substeps, p)
    rows = (volts, log["outputs"], log["there"], log["dt"])
    _, kept = jax.lax.scan(sample, (log["start"], _start_covariance(setting, intensity, log)), rows)
    return kept


def _measured(mean, covariance, expected, slope, y, there, noise):
    """Mean, covariance and log-likelihood after one sample's outputs, one after the other: their noises are independent."""
    first, likelihood = mean, jnp.zeros(())
    for i in range(len(y)):
        surprise = y[i] - expected[i] - slope[i] @ (mean - first)
        along = covariance @ slope[i]
        variance = slope[i] @ along + noise[i] ** 2
        gain = jnp.where(there[i], along / variance, 0.0)
        mean = mean + gain * surprise
        covariance = _symmetric(covariance - jnp.outer(gain, along))
        likelihood = likelihood - 0.5 * jnp.where(there[i], surprise**2 / variance + jnp.log(variance), 0.0)
    return mean, covariance, likelihood


def _walks(setting: _Setting):
    return jnp.array([setting.robot.states.index(_PREFIX + name) for name in setting.velocities])


def _walked(setting: _Setting, intensity, interval, log):
    """Covariance that one sample adds: the forces' random walk, and the integration's own error."""
    return jnp.diag(log["jitter"].at[_walks(setting)].set(intensity**2 * interval))


def _start_covariance(setting: _Setting, intensity, log):
    return jnp.diag(log["spread"].at[_walks(setting)].set(_START * intensity) ** 2)


def _likelihood(setting: _Setting, log, kept, used, intensity):
    """Log-likelihood of one log at `intensity`, linearised where a filter at the intensity `used` has been."""
    means, covariances, after, covariances_after, crosses, expected, slopes, predicted = kept

    def sample(carry, row):
        mean, covariance, total = carry
        base, base_covariance, next_, next_covariance, cross, expected, slope, predicted, y, there, interval = row
        expected = expected + slope @ (mean - predicted)
        mean, covariance, gained = _measured(mean, covariance, expected, slope, y, there, log["noise"])
        # Statistical linear regression: the matrix that the points' moments imply, and what it leaves over.
        spread = base_covariance + jnp.diag(log["jitter"])
        turn = jax.scipy.linalg.cho_solve((jnp.linalg.cholesky(spread), True), cross).T
        left = next_covariance - turn @ cross - _walked(setting, used, interval, log)
        covariance = turn @ covariance @ turn.T + left + _walked(setting, intensity, interval, log)
        return (next_ + turn @ (mean - base), _symmetric(covariance), total + gained), None

    start = (log["start"], _start_covariance(setting, intensity, log), jnp.zeros(()))
    moments = (means, covariances, after, covariances_after, crosses, expected, slopes, predicted)
    (_, _, total), _ = jax.lax.scan(sample, start, (*moments, log["outputs"], log["there"], log["dt"]))
    return total


def _smooth(kept):
    """Smoothed mean and standard deviation [T, n states] of one log, from its filter's moments."""
    mean, covariance, ahead, ahead_covariance, cross = kept[:5]

    def back(later, row):
        later_mean, later_covariance = later
        mean, covariance, ahead, ahead_covariance, cross = row
        gain = jax.scipy.linalg.cho_solve((jnp.linalg.cholesky(ahead_covariance), True), cross.T).T
        mean = mean + gain @ (later_mean - ahead)
        covariance = _symmetric(covariance + gain @ (later_covariance - ahead_covariance) @ gain.T)
        return (mean, covariance), (mean, jnp.sqrt(jnp.maximum(jnp.diag(covariance), 0.0)))

    # The last sample has no later one: start from its own prediction, which says nothing new.
    end = (ahead[-1], ahead_covariance[-1])
    _, smoothed = jax.lax.scan(back, end, (mean, covariance, ahead, ahead_covariance, cross), reverse=True)
    return smoothed


@partial(jax.jit, static_argnames="setting")
def _filtered(setting: _Setting, numbers, logs, intensity):
    return jax.vmap(lambda log: _filter(setting, numbers, log, intensity))(logs)


@partial(jax.jit, static_argnames="setting")
def _likelihoods(setting: _Setting, logs, kept, used, intensities):
    """Log-likelihood of all logs together for every row of `intensities` [lanes, n]."""

    def lane(intensity):
        return jnp.sum(jax.vmap(lambda log, own: _likelihood(setting, log, own, used, intensity))(logs, kept))

    return jax.vmap(lane)(intensities)


_smoothed = jax.jit(jax.vmap(_smooth))


# -- all logs ------------------------------------------------------------------------------------------------------
@partial(jax.jit, static_argnames="setting")
def _mobility(setting: _Setting, numbers, start: State):
    """Acceleration of each velocity per unit of its own force [n], all else apart."""
    robot = setting.robot
    idle = tuple(0.0 for _ in robot.channels.inputs)
    loose = tuple(0.0 for _ in robot.rubbing(start, numbers))
    found = []
    for name in setting.velocities:
        push = {key: jnp.full((), float(key == _PREFIX + name)) for key in start}
        found.append(jax.jvp(lambda s: robot.rates(s, idle, loose, numbers), (start,), (push,))[1][name])
    return jnp.stack(found)


def _force_scale(setting: _Setting, numbers, start: State, noise: Mapping[str, float]) -> NDArray[np.float64]:
    """Forces that change their own speed by one standard deviation of the noise within `_RESPONSE`."""
    mobility = np.maximum(np.abs(np.asarray(_mobility(setting, numbers, start))), 1e-12)
    return np.array([noise.get(name, 0.01) for name in setting.velocities]) / _RESPONSE / mobility


@partial(jax.jit, static_argnames=("robot", "integrator"))
def _sensed(robot: Robot, integrator: Integrator, numbers, start, inputs, dt):
    """What the measurement stages of the model's own effects add to its simulated outputs."""
    plain = replace(robot, effects=tuple(e for e in robot.effects if type(e).measure is Effect.measure))

    def one(s, u, d):
        bare = {name: s[name] for name in plain.states}
        return rollout(robot, numbers, s, u, d, integrator) - rollout(plain, numbers, bare, u, d, integrator)

    return jax.vmap(one)(start, inputs, dt)


def _arrays(robot: Robot, logs: LogSet, noise: Mapping[str, float], known, numbers, integrator: Integrator):
    """Everything the filter reads of each log, [E, ...]."""
    batch, begin = logs.batch(), initial_states(robot, logs)
    channels = logs.channels
    used = [c for c in channels.measured if c in channels.outputs or c in robot.states]
    levels = np.array([noise.get(c, np.nan) for c in used])
    columns = [channels.measured.index(c) for c in used]
    states = {name: np.array(value) for name, value in begin.states.items()}
    for e, log in enumerate(logs):
        for name, value in known.get(log.name, {}).items():
            if name in states:
                states[name][e] = value
    by_state = np.array([noise.get(name, np.nan) for name in robot.states])
    seen = np.isfinite(by_state)
    spread = np.where(seen, by_state, 1e-3)[None, :] * np.ones((len(logs), 1))
    estimated = np.array([name in robot.estimated_states for name in robot.states])
    spread = np.where(begin.uncertain[:, None] & estimated & ~seen, _UNSEEN_SPREAD, spread)
    outputs = batch.outputs
    if any(type(effect).measure is not Effect.measure for effect in robot.effects):
        start = {name: jnp.asarray(value) for name, value in states.items()}
        outputs = outputs - _sensed(robot.structure, integrator, numbers, start, batch.inputs, batch.dt)
    lanes = np.ones((len(logs), 1))
    return {
        "inputs": batch.inputs,
        "dt": batch.dt,
        "outputs": outputs[..., : max(columns) + 1],
        "there": (batch.mask & jnp.array([c in used for c in channels.measured]))[..., : max(columns) + 1],
        "start": jnp.stack([jnp.asarray(states[name]) for name in robot.states], axis=-1),
        "spread": jnp.asarray(spread),
        "noise": jnp.asarray(lanes * np.interp(range(max(columns) + 1), columns, np.nan_to_num(levels, nan=1.0))),
        "jitter": jnp.asarray(lanes * np.where(seen, (_MODEL_ERROR * by_state) ** 2, 1e-12)),
    }


def _chosen(setting: _Setting, numbers, arrays, scale):
    """Random-walk intensities of highest likelihood, and the filter's moments there.

    A filter at strong intensities is linearised where it went; in that linear model many intensities are tried at
    once, one force at a time, twice round. A second filter at the best of them repeats this.
    """
    n, levels = len(scale), np.array(_INTENSITIES)
    choice = np.full(n, _FIRST)
    for _ in range(_ROUNDS):
        used = jnp.asarray(levels[choice] * scale)
        kept, linearised = _filtered(setting, numbers, arrays, used), choice
        for _ in range(2 if n > 1 else 1):
            lanes = np.array([np.where(np.arange(n) == j, level, levels[choice]) for j in range(n) for level in levels])
            found = np.asarray(_likelihoods(setting, arrays, kept, used, jnp.asarray(lanes * scale)))
            found = np.where(np.isfinite(found), found, -np.inf).reshape(n, len(levels))
            choice = np.argmax(found, axis=1)
        if np.array_equal(choice, linearised):
            return np.asarray(used), kept
    used = jnp.asarray(levels[choice] * scale)
    return np.asarray(used), _filtered(setting, numbers, arrays, used)


@in_float64
def missing_force(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float] | None = None,
    known_states: Mapping[str, Mapping[str, float]] | None = None,
) -> tuple[ForceHistory, ...]:
    """The missing generalised forces of `robot` (fitted, with its effects) over time, one `ForceHistory` for each log.

    `noise` is the measurement noise by channel (default: what the data say), `known_states` estimated initial states by
    log name. Effects on commands act as in a rollout, states of effects are part of the state. Effects on measurements
    are accounted for by what they change in the model's own simulation: exactly for an offset, to first order otherwise.
    While model and robot stand still a force below break-away shows nowhere, and its standard deviation grows.

    Raises `NoVelocities` for a robot that does not say which states its forces accelerate.
    """
    pushed, names, units = forced(robot)
    noise = dict(noise or noise_level(logs))
    largest = {c: float(np.nanmax(np.abs(log.output(c)))) for log in logs for c in log.measured}
    noise = {c: max(level, 1e-4 * largest.get(c, 1.0)) for c, level in noise.items() if np.isfinite(level)}
    numbers = {name: jnp.asarray(float(value)) for name, value in pushed.parameters.numbers.items()}
    integrator = integrator_for(robot, logs)
    arrays = _arrays(pushed, logs, noise, known_states or {}, numbers, integrator)
    start = {name: arrays["start"][0, i] for i, name in enumerate(pushed.states)}
    setting = _Setting(pushed.structure, integrator, names)
    scale = _force_scale(setting, numbers, start, noise)
    intensity, kept = _chosen(setting, numbers, arrays, scale)
    mean, std = (np.asarray(x) for x in _smoothed(kept))
    columns = [pushed.states.index(_PREFIX + name) for name in names]
    return tuple(
        ForceHistory(
            log.name, log.time, mean[e, : len(log)][:, columns], std[e, : len(log)][:, columns],
            names, units, scale, intensity,
        )
        for e, log in enumerate(logs)
    )  # fmt: skip
