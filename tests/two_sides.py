"""A differential drive whose wheels stick, in steps of a quarter of a millisecond: dry friction of two wheels on one body, as
impulses that stop each where they may (projected Gauss-Seidel)."""

import numpy as np

from jaxid import DifferentialDrive, Log, LogSet

BEFORE = {"M": 9.4, "J": 0.21, "Fv": 7.0, "Fc": 1.9, "gain": 1.0}
HALF_TRACK = 0.165  # m


def stopping(right, left, own, other, most):
    """The impulses on the right and the left wheel of these speeds, each `most` at most, of which one changes its wheel's speed
    by `own` times its size and the other's by `other` times."""
    on_right = on_left = 0.0
    for _ in range(30):
        before = on_right, on_left
        on_right = min(max(-(right + other * on_left) / own, -most), most)
        on_left = min(max(-(left + other * on_right) / own, -most), most)
        if before == (on_right, on_left):
            break
    return on_right, on_left


def driven(seed, gyro=1.0, **changed):
    """Two runs of 20 s at 50 Hz."""
    M, J, Fv, Fc, gain = ({**BEFORE, **changed}[name] for name in BEFORE)
    robot, h, b = DifferentialDrive(), 2.5e-4, HALF_TRACK
    own, other = 1.0 / M + b**2 / J, 1.0 / M - b**2 / J
    found = []
    for run in range(2):
        rng = np.random.default_rng([seed, run])
        u = np.repeat(rng.uniform(-12.0, 12.0, (40, 2)) * rng.integers(0, 5, (40, 1)).clip(0, 1), 25, axis=0)
        v = w = 0.0
        rows = []
        for on_right, on_left in (gain * u).tolist():
            rows.append((v, gyro * w))
            for _ in range(80):
                right, left = on_right - Fv * (v + b * w), on_left - Fv * (v - b * w)
                v, w = v + h * (right + left) / M, w + h * b * (right - left) / J
                at_right, at_left, most = v + b * w, v - b * w, h * Fc
                dry_right, dry_left = stopping(at_right, at_left, own, other, most)
                v, w = v + (dry_right + dry_left) / M, w + b * (dry_right - dry_left) / J
        outputs = np.array(rows) + rng.normal(size=(len(rows), 2)) * (0.005, 0.015)
        found.append(Log.from_arrays(f"run {run}", 0.02 * np.arange(len(u)), u, outputs, robot.channels))
    return LogSet(found)
