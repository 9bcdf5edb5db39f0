"""Clean logs of wheeled robots and single axes of any size and speed, by a small simulation of its own.

Every robot is a few first-order axes with dry friction, driven through a mixing of its inputs. Time is counted in time
constants and speed in steady speeds at full input while it is simulated (all logs at once), and put into units afterwards:
sampling from kilohertz to one sample in two seconds, speeds, inputs and noise of any size.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from jaxid.logs import AXIS, Channels, Log

Array = NDArray[np.float64]

SAMPLES, SUBSTEPS = 500, 8

BODY = Channels(
    ("right", "left"), ("speed", "yaw_rate"), units={"right": "V", "left": "V", "speed": "m/s", "yaw_rate": "rad/s"},
    mixing={"speed": (1, 1), "yaw_rate": (1, -1)},
)  # fmt: skip
WHEELS = Channels(
    ("right", "left"), ("w_right", "w_left"), ("gyro",), units=dict.fromkeys(("w_right", "w_left", "gyro"), "rad/s"),
    mixing={"w_right": (1, 0), "w_left": (0, 1), "gyro": (1, -1)},
)  # fmt: skip
THREE = Channels(
    ("a", "b", "c"), ("vx", "vy", "turn"), units={"vx": "m/s", "vy": "m/s", "turn": "rad/s"},
    mixing={"vx": (-1, 1, 0), "vy": (-0.5, -0.5, 1), "turn": (1, 1, 1)},
)  # fmt: skip
ANGLE = Channels(("drive",), ("angle",), units={"angle": "rad"}, mixing={"angle": (1,)})
UNNAMED = Channels(("in",), ("out",), mixing={"out": (1,)})

ROBOTS = {"axis": AXIS, "body": BODY, "wheels": WHEELS, "three": THREE, "angle": ANGLE, "unnamed": UNNAMED}
RUNS = ["levels", "two levels", "sines", "straight and turning", "trapezoids"]


@dataclass(frozen=True)
class Made:
    """A clean log and what was put into it."""

    log: Log
    robot: str
    run: str


def _inputs(rng: np.random.Generator, run: str, inputs: int, interval: float) -> Array:
    """`[SAMPLES, inputs]`, at most 1 in size; `interval` in time constants."""
    time = interval * np.arange(SAMPLES)
    hold = max(2, round(rng.uniform(0.5, 3.0) / interval))
    stretches = -(-SAMPLES // hold)
    if run == "levels":
        found = np.repeat(rng.uniform(-1, 1, (stretches, inputs)), hold, axis=0)[:SAMPLES]
    elif run == "two levels":
        found = np.repeat(rng.choice([-1.0, 1.0], (stretches, inputs)), hold, axis=0)[:SAMPLES]
    elif run == "sines":
        frequencies = rng.uniform(0.3, 1.5, inputs)
        found = np.sin(np.outer(time, frequencies) + rng.uniform(0, 6, inputs)) * rng.uniform(0.6, 1.0, inputs)
    elif run == "straight and turning":
        # Long stretches of all inputs equal, of opposite ones, and of rest, at a few speeds.
        long = max(4, round(rng.uniform(3, 8) / interval))
        level = rng.choice([-1, -0.6, 0.6, 1.0], -(-SAMPLES // long))
        turning = rng.random(len(level)) < 0.4
        turning[1], turning[2] = True, False
        sides = np.where(np.arange(inputs) % 2 == 0, 1.0, -1.0)
        found = np.repeat(level[:, None] * np.where(turning[:, None], sides, 1.0), long, axis=0)[:SAMPLES]
    else:
        corners = np.cumsum(rng.uniform(1, 6, 4 * SAMPLES)) * 0.7
        kinds = np.tile([0.0, 1.0, 1.0, 0.0, 0.0, -1.0, -1.0, 0.0], SAMPLES)[: len(corners)]
        found = np.stack([np.interp(time + rng.uniform(0, 5), corners, kinds) for _ in range(inputs)], axis=1)
    found[: max(3, SAMPLES // 40)] = 0.0
    return found


def make(
    count: int, seed: int, robots: tuple[str, ...] = tuple(ROBOTS), runs: tuple[str, ...] = tuple(RUNS)
) -> list[Made]:
    """`count` clean logs, robots and runs in turn."""
    rng = np.random.default_rng(seed)
    plans = []
    for number in range(count):
        robot, run = robots[number % len(robots)], runs[number // len(robots) % len(runs)]
        interval = 10 ** rng.uniform(-1.5, -0.7)  # 5 to 32 samples a time constant
        plans.append((robot, run, interval, _inputs(rng, run, len(ROBOTS[robot].inputs), interval)))
    intervals = np.array([interval for _, _, interval, _ in plans])
    rows = [np.array(list(ROBOTS[robot].mixing.values()))[:, :] for robot, *_ in plans]
    push = np.zeros((SAMPLES, count, 3))
    for lane, ((robot, _, _, inputs), mixing) in enumerate(zip(plans, rows, strict=True)):
        push[:, lane, : len(mixing)] = inputs @ (mixing / np.abs(mixing).sum(axis=1, keepdims=True)).T
        if robot == "wheels":
            push[:, lane, 2] = 0.0
    lag = rng.uniform(0.7, 1.4, (count, 3))
    dry = rng.uniform(0.0, 0.15, (count, 3))
    turning = np.array([robot == "three" for robot, *_ in plans])
    state, travel = np.zeros((count, 3)), np.zeros((count, 3))
    speeds, ways = np.empty((SAMPLES, count, 3)), np.empty((SAMPLES, count, 3))
    for k in range(SAMPLES):
        speeds[k], ways[k] = state, travel
        for _ in range(SUBSTEPS):
            step = (intervals / SUBSTEPS)[:, None]
            rate = (push[k] - state - dry * np.tanh(state / 0.01)) / lag
            rate[:, 0] += turning * state[:, 2] * state[:, 1]
            rate[:, 1] -= turning * state[:, 2] * state[:, 0]
            state, travel = state + step * rate, travel + step * state
    return [_in_units(rng, *plan, speeds[:, lane], ways[:, lane]) for lane, plan in enumerate(plans)]


def _in_units(rng, robot: str, run: str, interval: float, inputs: Array, speed: Array, way: Array) -> Made:
    channels = ROBOTS[robot]
    volts = 10 ** rng.uniform(0, 2) if robot in ("body", "wheels", "three") else 10 ** rng.uniform(-3, 3)
    constant = 10 ** rng.uniform(-3, 1)  # s
    if robot in ("body", "three"):
        top = 10 ** rng.uniform(-1.3, 1)  # m/s; what crawls slower is asked for its unit
        constant = max(constant, 3 * top / 9.81, 0.05)  # tyres give no more, and nothing turns a robot faster
        turn = min(10 ** rng.uniform(-1, 1), 20.0)
        # The turning frame's own terms count W in radians a time constant.
        sizes = np.array([top, turn] if robot == "body" else [top, top, 1 / constant])
        outputs = speed[:, : len(sizes)] * sizes
    elif robot == "wheels":
        sizes = np.full(2, 10 ** rng.uniform(-1, 3))
        gear = 10 ** rng.uniform(-1.5, 0)
        wheels = speed[:, :2] * sizes
        outputs = np.concatenate([wheels, gear * (wheels[:, :1] - wheels[:, 1:])], axis=1)
    elif robot == "angle":
        size = 10 ** rng.uniform(-3, 3)
        outputs = size * (way[:, :1] + rng.uniform(-5, 5))
    else:
        size = 10 ** rng.uniform(-3, 3)
        outputs = size * speed[:, :1]
        if robot == "axis":
            outputs = np.concatenate([outputs, size * constant * way[:, :1] + 3 * size * rng.normal()], axis=1)
    spread = np.maximum(np.abs(outputs - outputs[0]).max(axis=0), 1e-12)
    noise = 10 ** rng.uniform(-3.5, -1.7) * (0.2 if robot == "angle" else 1.0)
    outputs = outputs + noise * spread * rng.normal(size=outputs.shape)
    time = interval * constant * np.arange(SAMPLES)
    name = f"{robot}, {run}"
    return Made(Log.from_arrays(name, time, volts * inputs, outputs, channels), robot, run)
