"""Simulated experiments as logs: `simulate` gives exact states at the samples, `simulate_log` a measured table."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from reference.effects import applied_voltage, complete, kernel_vector, measured
from reference.law_robots import filter_states, with_laws, with_other_constants
from reference.law_signals import commanded, input_shares, sensed, sensor_shares
from reference.law_table import Laws, complete_laws, on_signals
from reference.law_vector import K, law_vector
from reference.noise import added, jittered
from reference.robot import Robot
from reference.stick_slip import integrate

Effects = Mapping[str, Mapping[str, float]]
SAME_TIME = 1e-10  # s: break points closer than this are one


@dataclass(frozen=True)
class Run:
    """Exact result at the samples.

    t (N,), states (N, n), speeds as the sensor sees them before noise (N, n_v), friction modes just after the samples
    (N, axes), motor currents (N, motors; none but the omni's), and the number of friction events.
    """

    t: np.ndarray
    states: np.ndarray
    speeds: np.ndarray
    modes: np.ndarray
    currents: np.ndarray
    events: int


def _merged(times: np.ndarray) -> np.ndarray:
    times = np.sort(times)
    return times[np.concatenate(([True], np.diff(times) > SAME_TIME))]


def _at(breaks: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Indices of the break points that stand for `times`."""
    return np.searchsorted(breaks, times + SAME_TIME, side="right") - 1


def _pushes(push: Mapping[str, float], end: float) -> list[tuple[float, float]]:
    if push["force"] == 0 and push["moment"] == 0:
        return []
    starts = np.arange(push["start"], end, min(push["every"], 10 * end + 1))
    return [(start, start + push["duration"]) for start in starts]


def _arrived(voltage: np.ndarray, felt_from: np.ndarray, breaks: np.ndarray, shares: list) -> np.ndarray:
    """Inputs (len(breaks), m) felt after each break point, from shares with delays of their own."""
    u = np.zeros((len(breaks), voltage.shape[1]))
    for delays, weight in shares:
        for column in range(voltage.shape[1]):
            # A row whose delay is shorter than the one before may overtake it: the latest row that has arrived counts.
            order = np.argsort(felt_from + delays[:, column], kind="stable")
            latest = np.maximum.accumulate(order)
            place = np.searchsorted((felt_from + delays[:, column])[order], breaks + SAME_TIME, side="right") - 1
            u[:, column] += weight * np.where(place >= 0, voltage[latest[np.maximum(place, 0)], column], 0.0)
    return u


def _seen_columns(plain: np.ndarray, e: np.ndarray, robot: Robot) -> np.ndarray:
    """Columns of the states that the sensors see, where the laws' filters take the place of some of `plain`."""
    if e.size <= K.sensor_second:
        return plain
    columns, n_v = plain.copy(), len(plain)
    for k in range(n_v):
        if e[K.sensor_first + k] > 0.0:
            columns[k] = filter_states(robot) + k + (n_v if e[K.sensor_second + k] > 0.0 else 0)
    return columns


def simulate(
    robot: Robot,
    inputs: np.ndarray,
    sampling: float,
    effects: Effects | None = None,
    *,
    laws: Laws | None = None,
    start: Mapping[int, float] | None = None,
    rtol: float = 1e-9,
    atol: float = 1e-11,
    longest: float = 0.01,
) -> Run:
    """Integrate a robot from rest at the origin.

    :param inputs: (N, m) commanded inputs; row k is held from t_k to t_(k+1) (the last one is never felt).
    :param sampling: seconds.
    :param effects: {id: {parameter: value}}, see `reference.effects`.
    :param laws: {"mechanism/law": {parameter: value}}, see `reference.law_table`.
    :param start: {state index: value} for a start that is not at rest at the origin.
    Raises ValueError for inputs of the wrong shape or unknown effects, RuntimeError if the integration comes to a halt.
    """
    inputs = np.asarray(inputs, float)
    if inputs.ndim != 2 or inputs.shape[1] != len(robot.inputs) or not np.isfinite(inputs).all():
        raise ValueError(
            f"Inputs of '{robot.name}' must be finite and of shape (N, {len(robot.inputs)}), not {inputs.shape}."
        )
    full = complete(effects, robot.name)
    other = complete_laws(laws, robot.name)
    robot, e = with_other_constants(robot, kernel_vector(full), other)
    plain = robot
    if not all(on_signals(law) for law in other):
        robot, e = with_laws(robot, e, law_vector(other, robot.n_axes, len(robot.inputs)))
    p = np.array(list(robot.parameters.values()))
    n_v = len(robot.speeds)
    t = np.arange(len(inputs)) * sampling
    end = t[-1]
    delay, late = full["input_delay"]["delay"], full["sensor_delay"]["delay"]
    pushes = _pushes(full["push"], end)
    jumps = [full[name]["time"] for name in ("collision", "payload_drop") if next(iter(full[name].values())) != 0]
    extra = [*jumps, *(edge for pulse in pushes for edge in pulse)]
    arriving = input_shares(other, len(t), len(robot.inputs))
    passing = sensor_shares(other, len(t), n_v)
    extra += [time for delays, _ in arriving for time in np.unique(t[:, None] + delay + delays)]
    extra += [time for delays, _ in passing for time in np.unique(t[:, None] - late - delays)]
    breaks = np.concatenate((t, t + delay, t - late, np.array(extra)))
    breaks = _merged(breaks[(breaks >= 0) & (breaks <= end + SAME_TIME)])

    voltage = applied_voltage(commanded(inputs, other) if other else inputs, full)
    row = np.floor((breaks + SAME_TIME - delay) / sampling + 1e-9).astype(int)
    u = np.zeros((len(breaks), len(robot.inputs) + robot.n_forces))
    felt = row >= 0
    u[felt, : len(robot.inputs)] = voltage[np.minimum(row[felt], len(voltage) - 1)]
    if arriving:
        u[:, : len(robot.inputs)] = _arrived(voltage, t + delay, breaks, arriving)
    for begin, finish in pushes:
        pushed = (breaks > begin - SAME_TIME) & (breaks < finish - SAME_TIME)
        u[pushed, len(robot.inputs)] = full["push"]["force"]
        if robot.n_forces > 1:
            u[pushed, -1] = full["push"]["moment"]

    x = np.zeros(robot.n_states)
    for place, value in {**robot.initial, **(start or {})}.items():
        x[place] = value
    x[robot.filtered : robot.filtered + n_v] = x[robot.first : robot.first + n_v]
    states, modes = np.empty((len(breaks), robot.n_states)), np.zeros((len(breaks), robot.n_axes), int)
    edges = np.unique(_at(breaks, np.array([0.0, *[time for time in jumps if 0 < time < end], end])))
    events = 0
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        span = slice(first, last + 1)
        for name in ("collision", "payload_drop"):
            if abs(full[name]["time"] - breaks[first]) < SAME_TIME and first > 0:
                if name == "collision":
                    x[robot.first : robot.first + n_v] *= 1 - full[name]["speed_loss"]
                else:
                    p[list(robot.parameters).index(robot.mass)] -= full[name]["mass"]
        part, part_modes, count = integrate(
            robot.dynamics,
            x,
            breaks[span].copy(),
            u[span].copy(),
            p,
            e,
            robot.first,
            n_v,
            robot.n_axes,
            rtol,
            atol,
            longest,
        )
        if count < 0:
            raise RuntimeError(
                f"The integration of '{robot.name}' stopped between {breaks[first]:.3f} s and {breaks[last]:.3f} s."
            )
        states[span], modes[span], events = part, part_modes, events + count
        x = part[-1].copy()
    now = _at(breaks, t)
    seen = robot.filtered if full["sensor_lag"]["time_constant"] > 0 else robot.first
    columns = _seen_columns(np.arange(seen, seen + n_v), e, plain)
    if passing:
        speeds = np.zeros((len(t), n_v))
        for delays, weight in passing:
            then = _at(breaks, np.maximum(t[:, None] - late - delays, 0.0))
            speeds += weight * states[then, columns]
    else:
        speeds = states[_at(breaks, np.maximum(t - late, 0.0))][:, columns]
    speeds = measured(sensed(speeds, t, other) if other else speeds, full)
    currents = robot.currents(states[now], u[now], p, e) if robot.currents else np.empty((len(t), 0))
    return Run(t, states[now], speeds, modes[now], currents, events)


def simulate_log(
    robot: Robot,
    inputs: np.ndarray,
    sampling: float,
    noise: Sequence[float] | float = 0.0,
    seed: int = 0,
    effects: Effects | None = None,
    *,
    current_noise: float | None = None,
    noise_kind: str = "white",
    **options,
) -> pd.DataFrame:
    """A log in the standard columns: t, inputs as commanded, measured speeds (noise: standard deviation per speed).

    The omni's currents i1 to i4 are added when `current_noise` [A] is given; the axis also has its exact position q.
    `noise_kind` is one of `reference.noise.KINDS`.
    """
    run = simulate(robot, inputs, sampling, effects, **options)
    rng = np.random.default_rng(seed)
    speeds = added(run.speeds, np.broadcast_to(noise, run.speeds.shape[1]), noise_kind, rng)
    table = {
        "t": jittered(run.t, rng) if noise_kind == "jittered" else run.t,
        **dict(zip(robot.inputs, np.asarray(inputs, float).T, strict=True)),
    }
    table.update(zip(robot.speeds, speeds.T, strict=True))
    if robot.name == "axis":
        table["q"] = run.states[:, 0]
    if current_noise is not None:
        noisy = run.currents + rng.standard_normal(run.currents.shape) * current_noise
        table.update((f"i{k + 1}", noisy[:, k]) for k in range(noisy.shape[1]))
    return pd.DataFrame(table)
