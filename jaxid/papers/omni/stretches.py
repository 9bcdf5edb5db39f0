"""Which parts of an omni log the paper's methods may use, and the traction forces there.

Forces come from the motor currents by equations 4-8. Where a log has no currents i1..i4, they are computed from its
voltages and speeds with the motor model (eq. 9 without inductance); that cannot show a disconnected motor.
"""

import numpy as np
from numpy.typing import NDArray

from ..._float64 import in_float64
from ...logs import Log, LogError
from ...robots.effect import State
from ...robots.omni import Omni, body_forces
from .printed import AXES, Axis

Array = NDArray[np.float64]
MOVING = 0.05  # m/s or rad/s: below it an axis counts as at rest
SHORTEST = 1.0  # s: steady stretches shorter than this are not used
_WINDOW = 0.5  # s: a stretch is judged in windows of this length
_SURE = 4.0  # standard errors at which a trend counts as real
_DOUBT = 2.0  # the same over a whole stretch, where dropping a window too many costs little


def _noise(values: Array) -> float:
    """Standard deviation of white noise on a slow signal, from second differences and unharmed by single jumps."""
    second = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0)) if len(second) else 0.0


def speeds_of(log: Log) -> Array:
    """V, Vn [m/s] and W [rad/s], `[T, 3]`; raises `LogError` for another robot's log."""
    if tuple(log.channels.outputs) != AXES:
        raise LogError(f"{log.name} is no omni log (outputs {list(log.channels.outputs)}); read it with robot='omni'.")
    return log.outputs[:, :3]


def _rows(log: Log) -> NDArray[np.intp]:
    rows = np.flatnonzero(np.isfinite(speeds_of(log)).all(axis=1))
    if len(rows) < 10:
        raise LogError(f"{log.name} has V, Vn and W together at {len(rows)} sample(s); give a log with at least 10.")
    return rows


@in_float64
def currents(log: Log, robot: Omni | None = None) -> tuple[Array, bool]:
    """Motor currents [T, 4] A of an omni log and whether they were measured (else: computed by the motor model)."""
    robot = Omni() if robot is None else robot
    names = ("i1", "i2", "i3", "i4")
    there = [name for name in names if name in log.measured]
    if there and len(there) < 4:
        lacking = [name for name in names if name not in there]
        raise LogError(f"{log.name} has the currents {there} and lacks {lacking}; log all four or none of them.")
    if there:
        return np.stack([log.output(name) for name in names], axis=1), True
    state: State = {axis: column for axis, column in zip(AXES, speeds_of(log).T, strict=True)}
    computed = robot.currents(state, tuple(log.inputs.T), robot.parameters.numbers)
    return np.stack([np.asarray(i) for i in computed], axis=1), False


def forces(log: Log, robot: Omni | None = None) -> Array:
    """Fv, Fvn [N] and Gamma [N m], `[T, 3]`, of the log's motor currents (eqs. 4-8)."""
    robot = Omni() if robot is None else robot
    p = robot.parameters.numbers
    wheel = p["l"] * p["Kt"] / p["r"] * currents(log, robot)[0]
    return np.stack(body_forces(tuple(wheel.T), p), axis=1)


def _drifts(t: Array, v: Array, noise: Array, floor: float) -> bool:
    """Whether any speed [windows, n, 3] changes by a trend over all windows beyond its noise [3] and `floor`."""
    since = t.ravel() - t.mean()
    spread = float(since @ since)
    slope = since @ v.reshape(-1, v.shape[-1]) / spread
    return bool(np.any(np.ptp(t) * (np.abs(slope) - _DOUBT * noise / np.sqrt(spread)) > floor))


def steady_stretches(log: Log) -> list[slice]:
    """Stretches (rows) of at least 1 s in which no speed has a trend beyond its noise.

    The log is judged in windows of 0.5 s; a run of steady windows loses its first one, in which the last of the
    transient may hide, and further ones while the whole has a trend: a controller's integrator takes seconds to settle,
    and M dv/dt of a few mm/s² is as much as the friction differs between two speeds. Raises `LogError` for a log of
    another robot or without speeds.
    """
    rows = _rows(log)
    t, v = log.time[rows], speeds_of(log)[rows]
    n = max(8, round(_WINDOW / log.sampling_interval))
    count = len(rows) // n
    if count < 2:
        return []
    t, v = t[: count * n].reshape(count, n), v[: count * n].reshape(count, n, 3)
    centred = t - t.mean(axis=1, keepdims=True)
    spread = np.sum(centred**2, axis=1)[:, None]
    mean = v.mean(axis=1)
    slope = np.einsum("wn,wnk->wk", centred, v) / spread
    residual = v - mean[:, None] - centred[..., None] * slope[:, None]
    noise = np.median(np.sqrt(np.sum(residual**2, axis=1) / (n - 2)), axis=0)
    floor = 1e-3 * np.max(np.abs(mean)) + 1e-12  # for logs without noise
    flat = np.all(np.abs(slope) * _WINDOW < _SURE * noise / np.sqrt(spread) * _WINDOW + floor, axis=1)
    level = np.all(np.abs(np.diff(mean, axis=0)) < _SURE * noise * np.sqrt(2 / n) + floor, axis=1)

    found, first = [], 0
    for window in range(count):
        if not flat[window]:
            first = window + 1
            continue
        if window + 1 < count and flat[window + 1] and level[window]:
            continue
        begin = first + 1 if first > 0 or np.max(np.abs(mean[first])) > MOVING else first
        while begin < window and _drifts(t[begin : window + 1], v[begin : window + 1], noise, floor):
            begin += 1
        if (window + 1 - begin) * n * log.sampling_interval >= SHORTEST - 1e-9:
            found.append(slice(int(rows[begin * n]), int(rows[(window + 1) * n - 1]) + 1))
        first = window + 1
    return found


def force_free_stretch(log: Log, robot: Omni | None = None) -> tuple[Axis, slice]:
    """The axis that coasts and the longest stretch (rows) in which the robot moves and all four currents are null.

    Null means within the current's own noise (5 standard deviations and 2 % of the largest). Raises `LogError` if there
    are fewer than 10 such samples.
    """
    rows = _rows(log)
    v = speeds_of(log)[rows]
    current, measured = currents(log, robot)
    current = current[rows]
    noise = np.array([_noise(column[np.isfinite(column)]) for column in current.T])
    limit = np.maximum(5 * noise, 0.02 * np.nanmax(np.abs(current)))
    null = np.logical_not(np.any(np.abs(current) > limit, axis=1))
    null[1:-1] |= null[:-2] & null[2:]  # a single outlier does not end a stretch
    smooth = np.stack([np.convolve(v[:, j], np.full(5, 0.2), mode="same") for j in range(3)], axis=1)
    still = np.array([max(MOVING, 5 * _noise(v[:, j])) for j in range(3)])
    coasting = null & (np.abs(smooth) > still).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], coasting.astype(int), [0]])))
    runs = [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    longest = max(runs, key=lambda run: run.stop - run.start, default=slice(0, 0))
    if longest.stop - longest.start < 10:
        why = (
            "switch the motors off at speed"
            if measured
            else ("its currents were computed from the voltages, which cannot show a disconnected motor: log i1..i4")
        )
        raise LogError(f"{log.name} has no 10 samples in which the robot moves with null motor currents; {why}.")
    j = int(np.argmax(np.mean(np.abs(v[longest]), axis=0)))
    return AXES[j], slice(int(rows[longest.start]), int(rows[longest.stop - 1]) + 1)
