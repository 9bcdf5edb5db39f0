"""Robots in closed loops on speeds that are differences of encoders' counts: a simulator of its own, in small steps, with
friction that sticks."""

import numpy as np

from jaxid import Log
from tests.two_sides import stopping

ROW, STEP = 0.02, 2e-4


def wanted(seed, seconds, most):
    """Set-points [rows] that are held for half a second to a second and a half."""
    random, values = np.random.default_rng(seed), []
    while len(values) * ROW < seconds:
        values += [random.uniform(-most, most)] * random.integers(25, 76)
    return np.array(values[: round(seconds / ROW)])


def axis_in_a_loop(name, robot, seed, count, seconds=20.0, looped=True, own=None):
    """A log of an axis M dv/dt = u - Fv v - Fc sgn v whose PI controller answers the counts' difference over each row; in an
    open loop the commands are those that the exact speed would have given. `own` force [N] of the speed acts beside them."""
    M, Fv, Fc = 2.0, 3.0, 1.5
    target = wanted(seed, seconds, 0.4)
    q = v = 0.0
    rounded = round(q / count)
    integral, rows = 0.0, []
    for r in target.tolist():
        now = round(q / count)
        seen, rounded = count * (now - rounded) / ROW, now
        off = r - (seen if looped else v)
        integral += 40.0 * ROW * off
        u = float(min(max(12.0 * off + integral, -12.0), 12.0))
        rows.append((u, seen))
        for _ in range(round(ROW / STEP)):
            before = v
            v += STEP / M * (u - Fv * (v + STEP / (2 * M) * (u - Fv * v)) - (own(v) if own else 0.0))
            v -= min(max(v, -STEP / M * Fc), STEP / M * Fc)
            q += STEP * (before + v) / 2
    u, seen = np.array(rows).T
    return Log.from_arrays(name, ROW * np.arange(len(u)), {"u": u}, {"v": seen}, robot)


def drive_in_a_loop(name, robot, seed, count, seconds=20.0):
    """A log of a differential drive (M 8 kg, J 0.15 kg m^2, wheels at 0.14 m, 4 N per volt, per side 6 N s/m and 2 N), whose
    sides' PI controllers answer the counts [m] of their own wheels; body speed and yaw rate are made of these."""
    M, J, b, gain, Fv, Fc = 8.0, 0.15, 0.14, 4.0, 6.0, 2.0
    ahead, turn = wanted(seed, seconds, 0.5), wanted(seed + 1000, seconds, 2.0)
    targets = np.stack([ahead + b * turn, ahead - b * turn], axis=1)
    way, v, w = [0.0, 0.0], 0.0, 0.0
    counted, integral, rows = np.zeros(2), np.zeros(2), []
    own, other = 1 / M + b**2 / J, 1 / M - b**2 / J
    for target in targets:
        now = np.round(np.array(way) / count)
        seen, counted = count * (now - counted) / ROW, now
        integral += 12.0 * ROW * (target - seen)
        u = np.clip(5.0 * (target - seen) + integral, -12.0, 12.0).tolist()
        rows.append((*u, seen.mean(), (seen[0] - seen[1]) / (2 * b)))
        for _ in range(round(ROW / STEP)):
            one, two = v + b * w, v - b * w
            right, left = gain * u[0] - Fv * one, gain * u[1] - Fv * two
            before = one, two
            v, w = v + STEP * (right + left) / M, w + STEP * b * (right - left) / J
            one, two = stopping(v + b * w, v - b * w, own, other, STEP * Fc)
            v, w = v + (one + two) / M, w + b * (one - two) / J
            way[0] += STEP * (before[0] + v + b * w) / 2
            way[1] += STEP * (before[1] + v - b * w) / 2
    right, left, speed, rate = np.array(rows).T
    time = ROW * np.arange(len(right))
    return Log.from_arrays(name, time, {"u_right": right, "u_left": left}, {"v": speed, "w": rate}, robot)
