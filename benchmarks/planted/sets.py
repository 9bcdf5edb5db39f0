"""The recordings, the robots that they are fitted with, and what is planted in each."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from jaxid import Channels, Custom, Log, LogSet, Parameter
from jaxid.robots.effect import Effect
from jaxid.robots.robot import Robot

from ..explained import CASES
from ..measured_sets import robojackets, robojackets_log
from . import plants
from .plants import Planted

DELAY, LAG = ("sensor_delay", "input_delay"), ("sensor_lag", "motor_lag")
BIAS, SCALE = ("sensor_bias",), ("sensor_scale",)


@dataclass(frozen=True)
class Recorded:
    """One set: its robot, logs to fit and held-out ones, a user's own candidates, and what is planted."""

    robot: Robot
    fit: LogSet
    held_out: LogSet
    planted: tuple[Planted, ...]
    effects: tuple[Effect, ...] = field(default=())


def _late(samples: int, interval: float) -> Planted:
    seconds = samples * interval
    sizes = {("sensor_delay", "delay"): seconds, ("input_delay", "delay"): seconds}
    return Planted("late", plants.late(samples), DELAY, sizes=sizes)


def _filtered(seconds: float) -> Planted:
    sizes = {(mechanism, "time_constant"): seconds for mechanism in LAG}
    return Planted("filtered", plants.filtered(seconds), LAG, sizes=sizes)


def _common(late: int, interval: float, lag: float, step: float) -> list[Planted]:
    """What every set gets: late, filtered, quantised (no effect), and five per cent of the rows lost (none, either)."""
    return [
        _late(late, interval),
        _filtered(lag),
        Planted("quantised", plants.quantised(step)),
        Planted("rows lost", plants.with_rows_lost(0.05, 7)),
    ]


def _biased(channel: str, offset: float, absorbed: bool) -> Planted:
    sizes = {("sensor_bias", f"bias_{channel}"): offset}
    return Planted(f"biased {channel}", plants.biased(channel, offset), BIAS, absorbed, sizes)


def _explained(name: str, planted: list[Planted]) -> Callable[[Path], Recorded]:
    def made(data: Path) -> Recorded:
        case = CASES[name](data)
        return Recorded(case.robot, case.fit, case.held_out, tuple(planted), case.effects)

    return made


def _robotrace(name: str, level: float, late: int, lag: float, step: float, bias: float) -> Callable[[Path], Recorded]:
    """One axis under two levels of duty: of these neither a dead zone nor a scale can be told from the gain."""
    drift = Planted("drifting", plants.biased("v", 0.0, bias), BIAS)
    limit = Planted("limit", plants.behind_a_limit(level, 1.8, 3), ("voltage_saturation",))
    own = [
        _biased("v", bias, True),  # with a free offset, friction alone could tell
        drift,
        limit,
        Planted("scaled", plants.scaled("v", 1.1), (), True),
        Planted("dead zone", plants.behind_a_dead_zone(0.2 * level), (), True),
    ]
    return _explained(name, [*_common(late, 0.001, lag, step), *own])


def _emps() -> Callable[[Path], Recorded]:
    width = 15.0  # N
    sizes = {("actuator_dead_zone", "width"): width}
    own = [
        _biased("v", 0.006, False),
        Planted("drifting", plants.biased("v", 0.0, 0.003), BIAS),
        Planted("scaled", plants.scaled("v", 1.1), SCALE, True),
        Planted("dead zone", plants.behind_a_dead_zone(width), ("actuator_dead_zone",), sizes=sizes),
    ]
    return _explained("emps", [*_common(4, 0.005, 0.02, 0.002), *own])


def _husky(name: str) -> Callable[[Path], Recorded]:
    """Currents without their signs, and missing where the ground drives a wheel: no filter can be planted behind them."""
    own = [Planted("scaled", plants.scaled("left", 1.2), (*SCALE, "motor_gain_mismatch"), True)]
    late = Planted("late", plants.late(2), DELAY)
    quantised = Planted("quantised", plants.quantised(0.2))
    return _explained(name, [late, quantised, *own])


def _car(data: Path) -> Recorded:
    """DART on rubber: throttle and steering in, speed and yaw rate out, ten rows a second."""
    channels = Channels(("throttle", "steering"), ("v", "W"), units={"steering": "rad", "v": "m/s", "W": "rad/s"})

    def dynamics(state, u, p, friction):
        turning = state["v"] * p["ratio"] * (u["steering"] - p["trim"]) / 0.1735
        return {
            "v": p["gain"] * u["throttle"] - p["drag"] * state["v"] - friction["wheels"],
            "W": (turning - state["W"]) / p["settling"],
        }

    table = {
        "gain": Parameter(15.0, "m/s²", free=True, lower=0.0),
        "drag": Parameter(1.0, "1/s", free=True, lower=0.0),
        "coulomb": Parameter(2.0, "m/s²", free=True, lower=0.0),
        "ratio": Parameter(0.3, "", free=True, lower=0.0),
        "trim": Parameter(0.0, "rad", free=True, typical=0.1),
        "settling": Parameter(0.15, "s", free=True, lower=0.01),
    }
    robot = Custom(
        dynamics=dynamics,
        state_names=("v", "W"),
        own_channels=channels,
        table=table,
        dry_friction={"wheels": ("v", "coulomb")},
        turning="W",
        title="car",
    )
    logs = []
    for folder in ("throttle_steps_rubber", "sinusoidal_steering", "steering_steps"):
        for path in sorted((data / "dart" / folder).glob("*.csv.gz")):
            rows = pd.read_csv(path).drop_duplicates("elapsed time sensors")
            rows.columns = [str(column).strip() for column in rows.columns]
            time = rows["elapsed time sensors"].to_numpy(float)
            rows = rows[np.concatenate([[True], np.diff(time) > 0])]
            time = rows["elapsed time sensors"].to_numpy(float)
            throttle = rows["throttle"] * rows["safety_value"]
            inputs = np.stack([throttle, rows["steering"]], axis=1)
            outputs = {"v": rows["vel encoder"], "W": rows["W (IMU)"]}
            logs.append(Log.from_arrays(f"{folder} {path.name[:-7]}", time - time[0], inputs, outputs, channels))
    held_out = LogSet(logs[2::3])
    fit = LogSet([log for k, log in enumerate(logs) if k % 3 != 2])
    own = [
        _biased("W", 0.25, False),
        Planted("drifting", plants.biased("W", 0.0, 0.05), BIAS),
        Planted("scaled", plants.scaled("W", 1.2), SCALE, True),
        Planted("yaw rate late", plants.one_late("W", 3), ("sensor_delay", "steering_delay")),
        Planted("dead zone", plants.behind_a_dead_zone(0.05, (0,)), ("actuator_dead_zone",)),
    ]
    return Recorded(robot, fit, held_out, (*_common(3, 0.1, 0.25, 0.05), *own))


def _robojackets(data: Path) -> Recorded:
    """Half-second pieces of four omni wheels in volts."""
    pieces: list[Log] = []
    for name in robojackets_log.NAMES:
        whole = robojackets_log.without_idle(robojackets_log.load(data / "robojackets", name))
        driven = robojackets_log.driven(whole)
        pieces += [replace(p, name=f"{name} {k}", extra=pd.DataFrame()) for k, p in enumerate(driven)]
    pieces = pieces[::2]
    held_out, fit = LogSet(pieces[2::3]), LogSet([p for k, p in enumerate(pieces) if k % 3 != 2])
    gain = Planted("weaker motor", plants.behind_a_gain(1, 0.8), ("motor_gain_mismatch",))
    zone = Planted("dead zone", plants.behind_a_dead_zone(0.5), ("actuator_dead_zone",), True)
    own = [_biased("W", 1.0, False), Planted("scaled", plants.scaled("W", 1.2), SCALE), gain, zone]
    return Recorded(robojackets.robot(), fit, held_out, (*_common(3, 0.005, 0.02, 0.05), *own))


SETS: dict[str, Callable[[Path], Recorded]] = {
    "tra_A": _robotrace("tra_A", 0.2, 20, 0.02, 0.02, 0.1),
    "rot_A": _robotrace("rot_A", 0.3, 10, 0.012, 0.3, 1.5),
    "rot_B": _robotrace("rot_B", 0.3, 10, 0.012, 0.3, 1.5),
    "tra_C_fan": _robotrace("tra_C_fan", 0.3, 20, 0.02, 0.02, 0.1),
    "emps": _emps(),
    "dart": _car,
    "husky_wetgrass": _husky("husky_wetgrass"),
    "husky_wheels_up": _husky("husky_wheels_up"),
    "robojackets": _robojackets,
}
COUNTS = {"tra_A": 10, "rot_A": 10, "rot_B": 10, "tra_C_fan": 10, "emps": 9, "dart": 10, "husky_wetgrass": 4}
COUNTS |= {"husky_wheels_up": 4, "robojackets": 9}
"""Cases of every set, the one with nothing planted included; a recording need not be at hand to count them."""
