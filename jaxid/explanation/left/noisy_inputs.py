"""Is what a model leaves what noise of its inputs makes?

Commands as they were measured, a supply's voltage as it was read: what acted is another one, in each sample by chance. The
motion integrates it, so that what is left is as slow as the robot and no sensor's, and follows nothing. A filter that knows
of it undoes that: between two samples the state is as uncertain as inputs of such noise make it. If that is all, the
innovations are white, of the size that the filter foretells on every log, and follow nothing that drove the robot.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from ..._compile import compiled
from ..._distributions import chi_squared_tail, normal_tail
from ..._float64 import in_float64
from ...estimate.judge import drivers
from ...estimate.portmanteau import robust_portmanteau
from ...estimate.prediction_error.cubature import Moments, carried
from ...estimate.prediction_error.filter import (
    Model,
    Record,
    advance,
    as_state,
    filter_pass,
    held_inputs,
    observe,
    substeps,
)
from ...estimate.prediction_error.late_sensors import with_lagged
from ...estimate.prediction_error.setup import Task, build
from ...estimate.residual_tests import cross_correlation, related_squares, relation
from ...logs import LogError, LogSet
from ...logs.noise import usual_size
from ...parameters import ParameterError
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ...simulation.scaled import Scales
from .heldout import HeldOut

_SIZES = np.geomspace(0.005, 0.6, 7)
"""Standard deviations that are tried, as shares of the usual input, or of what acts."""
_FINER = np.geomspace(0.4, 2.5, 7)
"""Factors by which the best of them is tried again."""
_SENSORS = np.geomspace(0.5, 1.3, 7)
"""Factors of the sensors' noise that are tried: quick motion passes for noise in the differences of samples."""
_LAST = np.geomspace(0.87, 1.15, 7)
"""Factors by which all are tried once more, beside each other."""
_KINDS = 3
_WORTH, _MUCH = 20.0, 200.0
"""Twice the drop of -log L that a further kind of noise must bring, and all noise of the inputs together."""
_UNRELATED = 1e-3
"""p value below which the residual itself follows what drove the robot: something is missing then, and no filter is asked."""
_ENOUGH = 400
"""Samples from a log's start on by which sizes are chosen; all of them are tested."""
_LAGS = 20
_SLACK = 0.1
"""Share by which innovations may be larger than foretold: dry friction is no linear function of the speed."""
_FEWEST = 40
_BEFORE = 2
"""Samples before the innovation that drivers are taken from: the one before holds the noise that it shows."""
_STEP = 1e-3


@dataclass(frozen=True)
class InputNoise:
    """Noise of the inputs: its standard deviation as a share of the usual input, of each input as it acts, and of all inputs
    alike (a supply's voltage); `p_value` of all tests of the innovations together."""

    sizes: tuple[float, float, float]
    p_value: float

    @property
    def phrase(self) -> str:
        """How large it is, in words."""
        own, each, every = (f"{100 * size:.2g} %" for size in self.sizes)
        words = (f"{own} of their usual size", f"{each} of each of them", f"{every} of all of them alike")
        return " and ".join(word for word, size in zip(words, self.sizes, strict=True) if size)

    def to_dict(self) -> dict[str, float]:
        """For explanation.json."""
        return dict(zip(("of_usual_input", "of_each_input", "of_all_inputs"), self.sizes, strict=True))


@in_float64
def noise_of_inputs(
    robot: Robot, states: Sequence[tuple[HeldOut, LogSet]], noise: Mapping[str, float], scales: Scales, level: float
) -> InputNoise | None:
    """The noise of the inputs that is all that `robot` leaves on `states`, whose sensors have this `noise`, at a `level`.

    None where more is left, or where nothing tells: a robot without inputs or whose sensors a filter cannot have.
    """
    logs = LogSet([log for _, own in states for log in own])
    driving = _driving(logs, states)
    usual = np.array([scales.input_of(name) for name in logs.channels.inputs])
    sensors = np.array([noise.get(name, np.nan) for name in logs.channels.measured])
    sensors = np.where(np.isfinite(sensors) & (sensors > 0.0), sensors, np.inf)
    if not usual.size or not (usual > 0.0).all() or _follows(states, driving):
        return None
    try:
        # Steps that a fit was found to need are finer than a filter needs.
        steps = Integrator.suited(replace(robot, longest_step=np.inf), max(log.sampling_interval for log in logs))
        task = build(robot, logs, start=robot.parameters.numbers, integrator=steps)
    except (ParameterError, LogError):
        return None
    found = _likeliest(task, dict(robot.parameters.numbers), usual, sensors)
    # On one channel slow noise of the sensor, or any force, may look as noise of a size of its own does.
    seen = np.isfinite(sensors) & np.asarray(task.problem.records.there).any(axis=(0, 1))
    if found is None or (seen.sum() < 2 and not found[1:_KINDS].any()):
        return None
    white = _less_parameters(task, robot, usual, sensors, found)
    p_value = _as_foretold(white, logs, driving)
    own, each, every = found[:_KINDS].tolist()
    return InputNoise((own, each, every), p_value) if p_value >= level else None


def _driving(logs: LogSet, states: Sequence[tuple[HeldOut, LogSet]]) -> dict[str, list[NDArray[np.float64]]]:
    """What drove the robot, some samples earlier: what was measured of an input holds its noise, and so does the motion
    that a simulation makes of it."""
    simulated = []
    for state, own in states:
        for log, residual in zip(own, state.residuals, strict=True):
            every = np.full((len(log), len(logs.channels.measured)), np.nan)
            for i, name in enumerate(state.by_channel):
                every[:, logs.channels.measured.index(name)] = log.output(name) + residual[:, i] * state.noise[name]
            simulated.append(every)
    return {
        name: [np.concatenate([np.full(_BEFORE, values[0]), values[:-_BEFORE]]) for values in own]
        for name, own in drivers(logs, simulated).items()
    }


def _follows(states: Sequence[tuple[HeldOut, LogSet]], driving: Mapping[str, Sequence[NDArray[np.float64]]]) -> bool:
    """Whether the residuals themselves follow what drove the robot."""
    for name in states[0][0].by_channel:
        own = [(state.residuals[k], state.by_channel) for state, logs in states for k in range(len(logs))]
        parts = [residual[:, list(names).index(name)] if name in names else residual[:, :0] for residual, names in own]
        kept = [e for e, part in enumerate(parts) if np.isfinite(part).sum() > _FEWEST]
        drove = {driver: [values[e] for e in kept] for driver, values in driving.items()}
        if kept and relation([parts[e] for e in kept], drove)[0] < _UNRELATED:
            return True
    return False


@partial(compiled, static_argnames=("model",))
def _innovations(model: Model, numbers, records: Record, noise, usual: Float[Array, " nu"], sizes: Float[Array, "K n"]):
    """Innovations and their variances [K, E, T, ny] beside noise of the inputs of each of the `sizes`, of which those behind
    the kinds are factors of the sensors' `noise`."""
    m, nu = substeps(model.integrator), usual.shape[0]

    def one(record: Record, size):
        fine, nx = held_inputs(model, numbers, record), record.floor.shape[0]
        # Of the samples on both sides: in proportion to what was measured in the sample itself, noise would weigh its own.
        acts = fine[:, 0]
        acts = (jnp.concatenate([acts[:1], acts[:-1]]) + jnp.concatenate([acts[1:], acts[-1:]])) / 2.0
        floor = jnp.concatenate([record.floor, (1e-9 * usual) ** 2])

        def propagate(moments: Moments, row):
            inputs, interval, acting = row
            spread = jnp.diag((size[0] * usual) ** 2 + (size[1] * acting) ** 2) + size[2] ** 2 * jnp.outer(
                acting, acting
            )
            covariance = jnp.zeros((nx + nu, nx + nu)).at[:nx, :nx].set(moments.covariance).at[nx:, nx:].set(spread)

            def over(both):
                def substep(state, held):
                    return advance(model, numbers, state, held + both[nx:], interval / m), None

                return jax.lax.scan(substep, both[:nx], inputs)[0]

            return carried(Moments(jnp.concatenate([moments.mean, jnp.zeros(nu)]), covariance), over, floor)[0], None

        def look(x, seen):
            return observe(model.robot, numbers, x, seen)[: record.outputs.shape[1]]

        rows = ((fine, record.dt, acts), fine[:, 0], record.outputs, record.there)
        start = with_lagged(model.robot, numbers, record.start, fine[0, 0], as_state)
        news = filter_pass(look, propagate, start, rows, noise * size[_KINDS:])[4]
        return news.surprise, news.variance

    return jax.lax.map(lambda size: jax.vmap(lambda record: one(record, size))(records), sizes)


def _filtered(task: Task, numbers, usual, sensors, sizes: Float[NDArray, "K n"], first: int | None = None):
    """Innovations and variances [K, E, T, ny], 0 and 1 where there are none, of the `first` samples of every log."""
    records = task.problem.records
    records = records._replace(
        **{name: getattr(records, name)[:, :first] for name in ("dt", "inputs", "outputs", "there")}
    )
    seen = np.asarray(records.there) & np.isfinite(sensors)
    records = records._replace(there=jnp.asarray(seen))
    known = np.where(np.isfinite(sensors), sensors, 1.0)
    surprise, variance = _innovations(task.model, numbers, records, known, usual, sizes)
    return np.asarray(surprise), np.asarray(variance), seen


def _likeliest(task: Task, numbers, usual, sensors) -> NDArray[np.float64] | None:
    """The likeliest sizes of the noise of the inputs, kind by kind, and the factors of the sensors' [3 + ny]; None where noise
    of the inputs brings too little."""

    there = np.asarray(task.problem.records.there)
    # Of all samples as of those that are looked at.
    times = float(there.sum() / max(there[:, :_ENOUGH].sum(), 1))

    def costs(sizes: Float[NDArray, "K n"]) -> Float[NDArray, " K"]:
        # As many at a time, whatever is tried, for one program.
        padded = np.concatenate([sizes, np.repeat(sizes[-1:], len(_SIZES) - len(sizes), axis=0)])
        surprise, variance, seen = _filtered(task, numbers, usual, sensors, padded, _ENOUGH)
        with np.errstate(all="ignore"):
            found = np.sum(np.where(seen, surprise**2 / variance + np.log(variance), 0.0), axis=(1, 2, 3))
        return times * np.where(np.isfinite(found), found, np.inf)[: len(sizes)]

    def best(at: NDArray[np.float64], kind: int, of: Float[NDArray, " k"]) -> tuple[float, NDArray[np.float64]]:
        rows = np.tile(at, (len(of), 1))
        rows[:, kind] = of
        every = costs(rows)
        return float(every.min()), rows[int(every.argmin())]

    own = [int(sensor) for sensor in _KINDS + np.flatnonzero(np.isfinite(sensors))]

    def with_sensors(cost: float, at: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        for sensor in own:
            likelier = best(at, sensor, _SENSORS)
            cost, at = likelier if likelier[0] < cost else (cost, at)
        return cost, at

    at = np.append(np.zeros(_KINDS), np.ones(len(sensors)))
    # Sensors whose noise is rated too small are no noise of the inputs either.
    cost, at = with_sensors(float(costs(at[None])[0]), at)
    nothing = cost
    left = list(range(_KINDS if len(usual) > 1 else _KINDS - 1))
    while left:
        found = {kind: best(at, kind, _SIZES) for kind in left}
        kind = min(found, key=lambda kind: found[kind][0])
        if not found[kind][0] < cost - _WORTH:
            break
        left.remove(kind)
        cost, at = found[kind]
        for other in (kind, *(k for k in range(_KINDS) if at[k] and k != kind)):
            cost, at = best(at, other, at[other] * _FINER)
        cost, at = with_sensors(cost, at)
        if not nothing - cost > _MUCH:
            return None
        left = left if _KINDS - len(left) < 2 else []  # of two kinds a third is not told
    if not at[:_KINDS].any():
        return None
    for place in (*own, *np.flatnonzero(at[:_KINDS]), *own):
        cost, at = best(at, int(place), at[int(place)] * _LAST)
    return at


def _less_parameters(task: Task, robot: Robot, usual, sensors, sizes: Float[NDArray, " n"]) -> NDArray[np.float64]:
    """Innovations [E, T, ny] in units of their own size, less what the free parameters can take up: weighted for noise of
    the sensors alone, they are off by more than innovations are."""
    numbers = dict(robot.parameters.numbers)
    (surprise,), (variance,), seen = _filtered(task, numbers, usual, sensors, sizes[None])
    white = np.where(seen, surprise / np.sqrt(variance), 0.0)
    columns = []
    for name in task.names:
        step = _STEP * (abs(numbers[name]) or robot.parameters[name].typical or 1.0)
        moved = _filtered(task, {**numbers, name: numbers[name] + step}, usual, sensors, sizes[None])[0][0]
        columns.append((np.where(seen, moved / np.sqrt(variance), 0.0) - white).ravel())
    matrix = np.stack(columns, axis=1)
    norms = np.linalg.norm(matrix, axis=0)
    usable = np.isfinite(norms) & (norms > 0.0)
    matrix = matrix[:, usable] / norms[usable]
    taken = matrix @ np.linalg.lstsq(matrix, white.ravel(), rcond=1e-6)[0]
    return np.where(seen, white - taken.reshape(white.shape), np.nan)


def _as_foretold(
    white: NDArray[np.float64], logs: LogSet, driving: Mapping[str, Sequence[NDArray[np.float64]]]
) -> float:
    """p value of innovations [E, T, ny], in units of their size, being white, as large as foretold on every log, without a
    mean, and unrelated to what drove the robot."""
    p_values = []
    for i in range(white.shape[-1]):
        parts = [white[e, : len(log), i] for e, log in enumerate(logs)]
        kept = [e for e, own in enumerate(parts) if np.isfinite(own).sum() > _FEWEST]
        if not kept:
            continue
        parts = [parts[e] for e in kept]
        drove = {name: [values[e] for e in kept] for name, values in driving.items()}
        there = [own[np.isfinite(own)] for own in parts]
        every = np.concatenate(there)
        mean = abs(every.mean()) * np.sqrt(len(every)) / max(every.std(), 1e-300)
        # A usual size has 1.6 times the variance of a standard deviation.
        far = [max(abs(np.log(usual_size(own))) - _SLACK, 0.0) * np.sqrt(len(own) / 0.82) for own in there]
        inputs = [name for name in drove if name in logs.channels.inputs]
        p_values += [
            float(chi_squared_tail(*robust_portmanteau(there, _LAGS))),
            2.0 * float(normal_tail(mean)),
            min(2.0 * float(normal_tail(max(far))) * len(far), 1.0),
            related_squares(there),
            relation(parts, drove)[0],
            *(cross_correlation(parts, drove[name])[0].p_value for name in inputs),
        ]
    return min(float(np.nanmin(p_values)) * len(p_values), 1.0) if p_values else 0.0
