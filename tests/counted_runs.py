"""Runs of robots whose wheels' encoders are all that is logged: from the independent simulator, whose dry friction sticks.

Speeds are simulated every millisecond and integrated by Simpson's rule; what happens between the wheel and the log (a delay, a
filter, an average) happens to the angles on that grid, before they are counted.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.integrate import cumulative_simpson

import jaxid
from jaxid import Channels, Custom, Log, LogSet, Parameter
from jaxid.robots.drive_axis import DriveAxis

FIT = ("prbs_forward", "prbs_reversing", "multilevel", "steps", "crawl")
CHECK = ("prbs_reversing", "arcs", "crawl")


@dataclass(frozen=True)
class Hidden:
    """What a model lacks: `effects` of the simulator (of an own drive `stribeck` alone), and of the sensors a `delay` [s], a
    first-order `lag` [s], a mean over a `window` [s] about the stamp, and a relative error of the counts per turn (`scale`)."""

    effects: tuple = ()
    dead_zone: float = 0.0
    delay: float = 0.0
    lag: float = 0.0
    window: float = 0.0
    scale: float = 0.0


def own_drive() -> Custom:
    """A drive that a user describes by the speeds of its two rims, on wheels of radius r."""

    def rates(s, u, p, friction):
        force = {
            k: p["kf"] * (u[f"u{k}"] - p["ke"] * s[f"s{k}"]) - p["B"] * s[f"s{k}"] - friction[k] for k in ("R", "L")
        }
        ahead, spin = (force["R"] + force["L"]) / p["M"], p["L"] ** 2 * (force["R"] - force["L"]) / p["J"]
        return {"sR": ahead + spin, "sL": ahead - spin}

    table = {
        "M": Parameter(10.0, "kg", free=True), "J": Parameter(0.3, "kg m^2", free=True),
        "B": Parameter(6.0, "N s/m", free=True), "Fc": Parameter(2.0, "N", free=True),
        "kf": Parameter(5.0, "N/V"), "ke": Parameter(4.0, "V s/m"), "L": Parameter(0.17, "m"), "r": Parameter(0.08, "m"),
    }  # fmt: skip
    axes = {
        k: DriveAxis(
            f"s{k}", coulomb="Fc", viscous="B", angle=f"phi{k}", torque=lambda s, u, p, k=k: p["kf"] * u[f"u{k}"],
        )
        for k in ("R", "L")
    }  # fmt: skip
    return Custom(
        dynamics=rates, state_names=("sR", "sL"), own_channels=Channels(("uR", "uL"), ("sR", "sL")), table=table, axes=axes,
        velocities=("sR", "sL"), wheel_angles=True, title="own drive",
    )  # fmt: skip


def model(name: str):
    """The robot whose logs hold the angles of its wheels, of an axis its position."""
    return {
        "axis": lambda: jaxid.Axis().with_values(gain=10.0, M=20.0, Fv=30.0, Fc=8.0),
        "pioneer": lambda: jaxid.Pioneer(wheel_angles=True),
        "omni": lambda: jaxid.Omni(wheel_angles=True),
        "own drive": own_drive,
    }[name]()


def angle_names(name: str, robot) -> tuple[str, ...]:
    """The channels that are counted."""
    return ("q",) if name == "axis" else robot.measured_angles


def _rates(name: str, speeds, p):
    """Rates of the counted angles [T, wheels] of the simulator's speeds, by hand."""
    if name == "axis":
        return speeds
    if name == "omni":
        V, Vn, spin = speeds[:, 0], speeds[:, 1], p["b"] * speeds[:, 2]
        return np.stack([Vn + spin, spin - V, spin - Vn, V + spin], axis=1) / p["r"]
    ahead, spin = speeds[:, 0], p["L"] * speeds[:, 1]
    # An own drive's angles are the ways of its rims.
    return np.stack([ahead + spin, ahead - spin], axis=1) / (p["R"] if name == "pioneer" else 1.0)


@cache
def _simulated(
    name: str, kind: str, seed: int, samples: int, fine: int, sampling: float, effects: tuple, dead_zone: float
):
    """Time, inputs as commanded, angles [samples * fine, wheels] from zero."""
    from reference import mechanisms as me
    from reference.axis import AXIS
    from reference.excitation import experiment
    from reference.logs import simulate
    from reference.omni import OMNI
    from reference.pioneer import PIONEER

    u = experiment("pioneer" if name == "own drive" else name, kind, samples, seed)
    acting = np.sign(u) * np.maximum(np.abs(u) - dead_zone, 0.0)
    held, step = np.repeat(acting, fine, axis=0), sampling / fine
    rng = np.random.default_rng([len(name), 11])
    given = {effect: dict(values) for effect, values in effects}
    if name == "own drive":
        p = {"M": 10.0, "J": 0.3, "L": 0.17, "kf": 5.0, "ke": 4.0, "B": 6.0, "Fc": 2.0}
        p |= {n: p[n] * rng.uniform(0.85, 1.15) for n in ("M", "J", "B", "Fc")}
        e = me.NOTHING.copy()
        for n, value in given.get("stribeck_friction", {}).items():
            e[{"amplitude": me.E.stribeck, "speed": me.E.stribeck_speed}[n]] = value
        time = np.arange(len(held)) * step
        drive = me.DIFFERENTIAL_DRIVE
        layout = drive.first, drive.speeds, drive.n_axes
        vector, forces = np.array([p[s.name] for s in drive.symbols]), np.zeros((len(held), 2))
        speeds = me.states_at(drive.dynamics, vector, e, np.zeros(2), time, np.hstack([held, forces]), layout)
    else:
        reference = {"axis": AXIS, "pioneer": PIONEER, "omni": OMNI}[name]
        if name == "axis":
            reference = reference.with_parameters(J=20.0, k=10.0, Cv=30.0, Cs=8.0)
        from benchmarks.hidden.cases import UNKNOWN

        drawn = {n: reference.parameters[n] * rng.uniform(0.85, 1.15) for n in UNKNOWN[name]}
        reference = reference.with_parameters(**drawn)
        p = reference.parameters
        run = simulate(reference, held, step, given, rtol=1e-8, atol=1e-10)
        time, speeds = run.t, run.speeds
    return u, cumulative_simpson(_rates(name, speeds, p), x=time, axis=0, initial=0)


def logged(
    name: str, counts: float, hidden: Hidden, *, seed: int = 1, samples: int = 600, sampling: float = 0.02, fine: int = 20,
    stamps=None, fit=FIT, check=CHECK,
) -> tuple[LogSet, LogSet]:  # fmt: skip
    """Logs to fit and to hold out. `stamps(time, rng)` makes the stamps of the true times. Angles of an own drive and of an
    axis are of the turn of a wheel of 0.08 m."""
    from reference.encoder import averaged, counted, late, low_passed

    robot = model(name)
    names = angle_names(name, robot)
    turn = 2 * np.pi * (1.0 if name in ("pioneer", "omni") else 0.08)
    found = []
    for number, (role, kind) in enumerate([*(("fit", k) for k in fit), *(("check", k) for k in check)]):
        rng = np.random.default_rng([seed, number, 77])
        u, angles = _simulated(
            name, kind, 100 * seed + number, samples, fine, sampling, hidden.effects, hidden.dead_zone
        )
        step = sampling / fine
        if hidden.delay:
            angles = late(angles, round(hidden.delay / step))
        if hidden.lag:
            angles = low_passed(angles, hidden.lag / step)
        if hidden.window:
            angles = averaged(angles, round(hidden.window / step / 2), round(hidden.window / step / 2))
        seen = counted((1 + hidden.scale) * angles, counts, rng, turn)[::fine][:samples]
        time = sampling * np.arange(len(seen))
        time = time if stamps is None else stamps(time, rng)
        found.append(
            Log.from_arrays(f"{role} {kind}", time, u[: len(seen)], dict(zip(names, seen.T, strict=True)), robot)
        )
    return LogSet(found[: len(fit)]), LogSet(found[len(fit) :])
