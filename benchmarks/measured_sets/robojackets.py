"""RoboJackets: a RoboCup robot with four omni wheels, duties and encoders; geometry and motor constants published.

The user's-own-robot path: body speeds from the wheels' geometry, one motor law for all four wheels,
`volts = back_emf w + coulomb sgn w + inertia`, and the published wheel angles.
"""

from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from jaxid import Channels, Custom, Fit, Integrator, Log, LogSet, Parameter, output_error
from jaxid.logs import Finding, preflight

from . import PICTURE_WIDTH, Row, Section, save, table, values

Array = NDArray[np.float64]
NAMES = ("excite_1", "excite_2", "excite_3_vely", "excite_4_vely_4")
ANGLES, RADIUS, DISTANCE = np.deg2rad([30, 150, 219, 321]), 0.0285623, 0.0798576  # rad, m, m
GEOMETRY: Array = np.stack([-np.sin(ANGLES), np.cos(ANGLES), np.full(4, DISTANCE)], axis=1) / RADIUS
"""[wheels, (V, Vn, W)]: wheel speeds from body speeds."""
VOLTS_PER_COUNT = 19 / 512
"""Twice the authors' 19 / 1024, below which their own back-EMF would lie."""
BOOK_SLOPE = 30 / (380 * np.pi) * 3 + 1e-4 * 0.464 / 0.0251 * 3
"""V s/rad at the wheel: Ke / g + Kf R / (Kt g) with g = 1/3."""
_BODY = ("V", "Vn", "W")
_IDLE = 8  # counts; the firmware sends 3 or 4 when it is told to stand still
_SMOOTH = 2.0
"""rad/s over which a wheel's friction turns round; narrower is not resolved at 5 ms and leaves a larger residual."""
_PIECE = 100  # samples of an output-error window


def read(folder: Path, name: str) -> tuple[Array, Array, Array, Array]:
    """(interval [T] s, wheel speeds [T, 4] rad/s, duties [T, 4] counts, gyro [T]); debug lines are left out."""
    lines = (folder / name).read_text().splitlines()
    rows = [line.split(",") for line in lines if line.count(",") == 9]
    data = pd.DataFrame(rows).apply(pd.to_numeric, errors="coerce").dropna().to_numpy(float)
    interval = data[:, 8] / 18.432e6 * 2 * 128
    return interval, data[:, :4] * 2 * np.pi / (2048 * 3) / interval[:, None], data[:, 4:8], data[:, 9]


def _channels() -> Channels:
    mixing = {name: tuple(GEOMETRY[:, k]) for k, name in enumerate(_BODY)}
    units = {"V": "m/s", "Vn": "m/s", "W": "rad/s"}
    return Channels(("u1", "u2", "u3", "u4"), _BODY, units=units, mixing=mixing)


def load(folder: Path, name: str) -> Log:
    """A whole recording with body speeds, and the gyro among the extra columns."""
    interval, wheels, duty, gyro = read(folder, name)
    body = np.linalg.lstsq(GEOMETRY, wheels.T, rcond=None)[0].T
    time = np.concatenate([[0.0], np.cumsum(interval[:-1])])
    return Log.from_arrays(name, time, duty * VOLTS_PER_COUNT, body, _channels(), {"gyro_w": gyro})


def driven(log: Log) -> list[Log]:
    """The stretches in which the robot was driven, in pieces of half a second."""
    active = np.any(np.abs(log.inputs) > _IDLE * VOLTS_PER_COUNT, axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], active, [False]])))
    pieces = []
    for first, last in edges.reshape(-1, 2):
        for a in range(first, last - _PIECE + 1, _PIECE):
            pieces.append(log.window(log.time[a], log.time[a + _PIECE - 1] + 1e-6))
    return pieces


def robot() -> Custom:
    """Body with three inertias (in volts), one back-EMF slope and Coulomb level, and the turning terms' share kappa."""
    geometry = [[float(x) for x in row] for row in GEOMETRY]

    def dynamics(state, inputs, p):
        speeds = [state[name] for name in _BODY]
        net = []
        for k, row in enumerate(geometry):
            w = sum(g * s for g, s in zip(row, speeds, strict=True))
            net.append(inputs[f"u{k + 1}"] - p["back_emf"] * w - p["coulomb"] * jnp.tanh(w / _SMOOTH) - p["offset"])
        turning = (speeds[2] * speeds[1], -speeds[2] * speeds[0], 0.0)
        return {
            name: p[f"a_{name}"] * sum(row[k] * n for row, n in zip(geometry, net, strict=True))
            + p["kappa"] * turning[k]
            for k, name in enumerate(_BODY)
        }

    parameters = {
        "back_emf": Parameter(0.08, "V s/rad", free=True, lower=0.0),
        "coulomb": Parameter(0.5, "V", free=True, lower=0.0),
        "offset": Parameter(0.0, "V", free=True, typical=0.1),
        "a_V": Parameter(0.2, "m/(V s²) per 1/m", free=True, lower=0.0),
        "a_Vn": Parameter(0.08, "m/(V s²) per 1/m", free=True, lower=0.0),
        "a_W": Parameter(15.0, "1/(V s²)", free=True, lower=0.0),
        "kappa": Parameter(0.0, "", free=True, typical=1.0),
    }
    return Custom(
        dynamics=dynamics, state_names=_BODY, own_channels=_channels(), table=parameters, title="omni in volts"
    )


def without_idle(log: Log) -> Log:
    """The recording with the duties sent at standstill subtracted from all duties."""
    idle = np.all(np.abs(log.inputs) < _IDLE * VOLTS_PER_COUNT, axis=1)
    return replace(log, inputs=log.inputs - np.median(log.inputs[idle], axis=0))


def identify(pieces: list[Log], model: Custom | None = None) -> Fit:
    """Output error on driven pieces, each with its own initial speeds."""
    return output_error(model or robot(), LogSet(pieces), initial_states="estimate", integrator=Integrator(1))


def findings(log: Log) -> list[Finding]:
    """What pre-flight says, the gyro looked at as a sensor."""
    return preflight(log, also=["gyro_w"])


def _picture(logs: list[Log], fit: Fit, pictures: Path) -> str:
    figure, axes = plt.subplots(1, 2, figsize=(PICTURE_WIDTH, 4.0))
    k, c = fit["back_emf"].value, fit["coulomb"].value
    for log in logs:
        active = np.any(np.abs(log.inputs) > _IDLE * VOLTS_PER_COUNT, axis=1)
        wheels = (log.outputs @ GEOMETRY.T)[active]
        axes[0].plot(wheels.ravel(), log.inputs[active].ravel(), ".", ms=1.2, label=log.name)
    w = np.linspace(-60, 60, 241)
    axes[0].plot(w, k * w + c * np.sign(w), "k", lw=1.2, label="estimate at constant speed")
    axes[0].set_xlabel("wheel speed [rad/s]")
    axes[0].set_ylabel("voltage [V]")
    axes[0].legend(fontsize=7, markerscale=6)
    gyro = np.asarray(logs[0].extra["gyro_w"], float)
    axes[1].plot(logs[0].output("W"), gyro, ".", ms=1.5)
    axes[1].set_xlabel("yaw rate from the encoders [rad/s]")
    axes[1].set_ylabel("gyro_w as logged")
    axes[1].set_title(logs[0].name, fontsize=10)
    return save(figure, pictures, "robojackets.png")


def measure(folder: Path, pictures: Path) -> Section:
    """Pre-flight's findings and the back-EMF slope."""
    logs = [load(folder, name) for name in NAMES]
    found = {log.name: findings(log) for log in logs}
    fit = identify(sum((driven(log) for log in logs), []))
    idle_free = sum((driven(without_idle(log)) for log in logs), [])
    no_offset = identify(idle_free, robot().change("offset", free=False))
    subtracted = no_offset["back_emf"].value
    off_subtracted = 100 * (subtracted / BOOK_SLOPE - 1)
    slope = fit["back_emf"]
    off = 100 * (slope.value / BOOK_SLOPE - 1)
    checks = {name: {f.check for f in own} for name, own in found.items()}
    gyro = all(any(f.check == "dead_sensor" and f.column == "gyro_w" for f in own) for own in found.values())
    idle = all("idle" in own for own in checks.values())
    doubtful = [name for name, own in checks.items() if "doubtful_clock" in own]
    uneven = all("clock_jitter" in own for own in checks.values())
    flipped = [name for name, own in checks.items() if "frame_flipped" in own]
    rows = (
        Row("RoboJackets, dead gyro", "named in all four logs" if gyro else "missed", "named", gyro),
        Row("RoboJackets, idle stretches", "named in all four logs" if idle else "missed", "named", idle),
        Row(
            "RoboJackets, doubtful clock",
            f"uneven intervals in {'all four logs' if uneven else 'some logs'}, accelerations beyond grip in "
            + ", ".join(doubtful),
            "named",
            bool(doubtful) and uneven,
        ),
        Row("RoboJackets, wheel signs", f"named in {', '.join(flipped) or 'none'}", "named", bool(flipped)),
        Row(
            "RoboJackets, back-EMF slope",
            f"{slope.value:.4f} ± {1.96 * slope.std_error:.4f} V s/rad ({off:+.1f} %)",
            f"book {BOOK_SLOPE:.4f} V s/rad, within 4 %",
            abs(off) <= 4,
        ),
    )
    shown = {"dead_sensor", "idle", "doubtful_clock", "clock_jitter", "frame_flipped"}
    messages = [(log.name, f.severity, f.check, f.message) for log in logs for f in found[log.name] if f.check in shown]
    estimates = table(
        ("parameter", "estimate", "standard error", "unit"),
        [(name, fit[name].value, fit[name].std_error, fit[name].unit) for name in fit.free_names],
    )
    text = f"""
Four recordings of a four-wheel omni robot: duties and encoders of all wheels. Pre-flight, with the gyro looked at as a
sensor (`preflight(log, also=["gyro_w"])`):

{table(("log", "severity", "check", "message"), messages)}

Only the turning frame's own term tells the signs of all wheels together, and only the last recording turns and drives
at once. Output error on the driven pieces (half a second each, own initial speeds), all four logs, gives it as `kappa`
(+1 if the signs were right):

{estimates}

Volts are 19/512 a count; with the authors' 19/1024 the slope would be half, below the motor's own back-EMF. The duty of
3 or 4 counts at standstill is taken as logged and the estimated `offset` says what of it acts while driving. The choice
matters: with these counts subtracted and no offset the slope is {subtracted:.4f} V s/rad ({off_subtracted:+.1f} %).
The slope needs speeds and volts only; the accelerations `a` do not mean anything until the clock is trusted. The
residuals ({fit.noise["V"]:.2f} m/s, {fit.noise["Vn"]:.2f} m/s, {fit.noise["W"]:.2f} rad/s) are those of lost rows or
slipping wheels, not of sensors, so the standard errors are too small.

{_picture(logs, fit, pictures)}
"""
    figures = {
        "preflight": {name: [str(f) for f in own] for name, own in found.items()},
        "estimates": values(fit),
        "book_slope": BOOK_SLOPE,
        "slope_deviation_percent": off,
        "estimates_idle_subtracted": values(no_offset),
        "converged": fit.converged,
    }
    return Section("RoboJackets: four-wheel omni, duties and encoders", text, rows, figures)
