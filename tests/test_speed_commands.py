"""The how-to on robots that take speed commands: its robot is identified from logs of another simulator."""

import re
from pathlib import Path

import numpy as np

import jaxid

PAGE = Path(__file__).parents[1] / "docs/howto/speed_commands.md"
TRUTH = {"kp_v": 9.0, "ki_v": 14.0, "d_v": 1.6, "c_v": 0.35, "kp_w": 12.0, "ki_w": 20.0, "d_w": 2.5, "c_w": 0.8}


def driven(seed):
    """12 s at 50 Hz of a base whose two PI controllers run at 2 kHz; each axis sticks where it may."""
    rng, h = np.random.default_rng([11, seed]), 5e-4
    sets = np.repeat(rng.uniform(-1, 1, (15, 2)) * (0.7, 2.0) * rng.integers(0, 2, (15, 1)), 40, axis=0)
    speed, total, rows = np.zeros(2), np.zeros(2), []
    kp, ki, d, c = (np.array([TRUTH[f"{name}_{axis}"] for axis in "vw"]) for name in ("kp", "ki", "d", "c"))
    for wanted in sets:
        rows.append(speed)
        for _ in range(40):
            free = speed + h * (kp * (wanted - speed) + ki * total - d * speed)
            total = total + h * (wanted - speed)
            speed = np.sign(free) * np.maximum(np.abs(free) - h * c, 0.0)
    return sets, np.array(rows) + rng.normal(size=(len(rows), 2)) * (0.004, 0.012)


def test_the_base_of_the_page_is_identified():
    names: dict = {}
    exec(re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)[1], names)
    robot = names["base"]
    logs = []
    for seed in range(3):
        sets, outputs = driven(seed)
        logs.append(jaxid.Log.from_arrays(f"run {seed}", 0.02 * np.arange(len(sets)), sets, outputs, robot.channels))
    fit = jaxid.output_error(robot, jaxid.LogSet(logs))
    assert fit.trustworthy, fit.judgement.sentence
    for name, true in TRUTH.items():
        assert fit[name].status == "identified", name
        assert abs(fit[name].value - true) < max(4 * fit[name].std_error, 0.01 * true), (name, fit[name].value)
