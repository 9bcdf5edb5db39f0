"""The RoboJackets recordings: logs with body speeds, their driven pieces, and the slope at steady speed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from jaxid import Channels, Log

Array = NDArray[np.float64]
NAMES = ("excite_1", "excite_2", "excite_3_vely", "excite_4_vely_4")
ANGLES, RADIUS, DISTANCE = np.deg2rad([30, 150, 219, 321]), 0.0285623, 0.0798576  # rad, m, m
GEOMETRY: Array = np.stack([-np.sin(ANGLES), np.cos(ANGLES), np.full(4, DISTANCE)], axis=1) / RADIUS
"""[wheels, (V, Vn, W)]: wheel speeds from body speeds."""
VOLTS_PER_COUNT = 19 / 512
"""Twice the authors' 19 / 1024, below which their own back-EMF would lie."""
BOOK_SLOPE = 30 / (380 * np.pi) * 3 + 1e-4 * 0.464 / 0.0251 * 3
"""V s/rad at the wheel: Ke / g + Kf R / (Kt g) with g = 1/3."""
WHEELS = ("w1", "w2", "w3", "w4")
BODY = ("V", "Vn", "W")
IDLE = 8  # counts; the firmware sends 3 or 4 when it is told to stand still
_PIECE = 100  # samples of an output-error window
_STEADY = 20  # samples of a steady stretch, 0.1 s
CHANGES = (1.0, 2.0, 4.0)
"""rad/s that no wheel's mean may change by within a steady stretch; about 1 rad/s is the wheels' own disagreement."""
_TURNING = 4.0  # rad/s; slower wheels do not tell their friction's sign


def read(folder: Path, name: str) -> tuple[Array, Array, Array, Array]:
    """(interval [T] s, wheel speeds [T, 4] rad/s, duties [T, 4] counts, gyro [T]); debug lines are left out."""
    lines = (folder / name).read_text().splitlines()
    rows = [line.split(",") for line in lines if line.count(",") == 9]
    data = pd.DataFrame(rows).apply(pd.to_numeric, errors="coerce").dropna().to_numpy(float)
    interval = data[:, 8] / 18.432e6 * 2 * 128
    return interval, data[:, :4] * 2 * np.pi / (2048 * 3) / interval[:, None], data[:, 4:8], data[:, 9]


def channels() -> Channels:
    mixing = {name: tuple(GEOMETRY[:, k]) for k, name in enumerate(BODY)}
    units = {"V": "m/s", "Vn": "m/s", "W": "rad/s"}
    return Channels(("u1", "u2", "u3", "u4"), BODY, units=units, mixing=mixing)


def load(folder: Path, name: str) -> Log:
    """A whole recording with body speeds; the gyro and the wheels' own speeds are extra columns."""
    interval, wheels, duty, gyro = read(folder, name)
    body = np.linalg.lstsq(GEOMETRY, wheels.T, rcond=None)[0].T
    time = np.concatenate([[0.0], np.cumsum(interval[:-1])])
    extra = {"gyro_w": gyro} | dict(zip(WHEELS, wheels.T, strict=True))
    return Log.from_arrays(name, time, duty * VOLTS_PER_COUNT, body, channels(), extra)


def moving(log: Log) -> NDArray[np.bool_]:
    """Samples [T] at which some wheel is driven."""
    return np.any(np.abs(log.inputs) > IDLE * VOLTS_PER_COUNT, axis=1)


def wheel_speeds(log: Log) -> Array:
    """The encoders' own speeds [T, 4] in rad/s, not made to agree with the geometry."""
    return np.stack([np.asarray(log.extra[name], float) for name in WHEELS], axis=1)


def driven(log: Log) -> list[Log]:
    """The stretches in which the robot was driven, in pieces of half a second."""
    active = moving(log)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], active, [False]])))
    pieces = []
    for first, last in edges.reshape(-1, 2):
        for a in range(first, last - _PIECE + 1, _PIECE):
            pieces.append(log.window(log.time[a], log.time[a + _PIECE - 1] + 1e-6))
    return pieces


def without_idle(log: Log) -> Log:
    """The recording with the duties sent at standstill subtracted from all duties."""
    idle = np.all(np.abs(log.inputs) < IDLE * VOLTS_PER_COUNT, axis=1)
    return replace(log, inputs=log.inputs - np.median(log.inputs[idle], axis=0))


def steady(log: Log, change: float, *, fitted: bool = False) -> tuple[Array, Array]:
    """(wheel speeds [N] rad/s, voltages [N]): means over driven stretches in which no wheel changes by `change`.

    With `fitted` the wheel speeds are those of the body speeds, which agree with the geometry.
    """
    active, wheels = moving(log), log.outputs @ GEOMETRY.T if fitted else wheel_speeds(log)
    speeds, volts = [], []
    for first in range(0, len(wheels) - _STEADY, _STEADY):
        rows = slice(first, first + _STEADY)
        early, late = wheels[rows][: _STEADY // 2].mean(0), wheels[rows][_STEADY // 2 :].mean(0)
        if active[rows].all() and np.all(np.abs(late - early) < change):
            speeds.append(0.5 * (early + late))
            volts.append(log.inputs[rows].mean(0))
    w, u = np.reshape(speeds, -1), np.reshape(volts, -1)
    turning = np.abs(w) > _TURNING
    return w[turning], u[turning]


def steady_slope(logs: list[Log], change: float, *, fitted: bool = False) -> tuple[float, float, int]:
    """(slope [V s/rad], its standard error, points) of `volts = slope w + coulomb sgn w + offset` at steady speed.

    Needs neither the clock nor inertias: the first of the omni's published methods, on the wheels' own axes.
    """
    w, u = (np.concatenate(parts) for parts in zip(*(steady(log, change, fitted=fitted) for log in logs), strict=True))
    regressors = np.stack([w, np.sign(w), np.ones_like(w)], axis=1)
    theta, _, rank, _ = np.linalg.lstsq(regressors, u, rcond=None)
    if rank < 3:
        return float("nan"), float("nan"), len(w)
    variance = np.sum((u - regressors @ theta) ** 2) / (len(w) - 3) * np.linalg.inv(regressors.T @ regressors)
    return float(theta[0]), float(np.sqrt(variance[0, 0])), len(w)
