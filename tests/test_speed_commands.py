"""The how-to on robots that take speed commands: its robot is identified from logs of another simulator."""

import re
from pathlib import Path

import numpy as np

import jaxid
from tests.two_sides import stopping

PAGE = Path(__file__).parents[1] / "docs/howto/speed_commands.md"
TRUTH = {"kp_v": 9.0, "ki_v": 14.0, "kp_w": 12.0, "ki_w": 20.0, "d": 1.6, "c": 0.17, "q": 30.0}
HALF_TRACK = 0.15  # m


def driven(seed):
    """12 s at 50 Hz of a base whose two PI controllers run at 2 kHz; the wheels of each side stick where they may."""
    rng, h = np.random.default_rng([11, seed]), 5e-4
    sets = np.repeat(rng.uniform(-1, 1, (15, 2)) * (0.7, 2.0) * rng.integers(0, 2, (15, 1)), 40, axis=0)
    kp_v, ki_v, kp_w, ki_w, d, c, q = TRUTH.values()
    b, most = HALF_TRACK, h * c
    own, other = (
        1.0 + q * b**2,
        1.0 - q * b**2,
    )  # what an impulse on one side changes of its own speed and of the other's
    v = w = sum_v = sum_w = 0.0
    rows = []
    for v_set, w_set in sets.tolist():
        rows.append((v, w))
        for _ in range(40):
            v_free = v + h * (kp_v * (v_set - v) + ki_v * sum_v - d * v)
            w_free = w + h * (kp_w * (w_set - w) + ki_w * sum_w - q * b**2 * d * w)
            sum_v, sum_w = sum_v + h * (v_set - v), sum_w + h * (w_set - w)
            right, left = v_free + b * w_free, v_free - b * w_free
            on_right, on_left = stopping(right, left, own, other, most)
            v, w = v_free + on_right + on_left, w_free + q * b * (on_right - on_left)
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
