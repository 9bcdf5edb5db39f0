"""Values that stand in for lost samples, and values that repeat for reasons of their own."""

import numpy as np
import pytest

from jaxid import AXIS, Log
from jaxid.checks.preflight import preflight

COUNT, DT = 1500, 0.02


def drive(seed=1):
    rng = np.random.default_rng(seed)
    force = np.repeat(rng.uniform(-5.0, 5.0, COUNT // 30), 30)
    v = np.zeros(COUNT)
    for k in range(1, COUNT):
        free = v[k - 1] + DT * (force[k - 1] - 2.0 * v[k - 1])
        v[k] = np.sign(free) * max(abs(free) - 0.8 * DT, 0.0)
    return force, v, np.cumsum(v) * DT


def said(force, values, name="v"):
    return [f for f in preflight(Log.from_arrays("a.csv", DT * np.arange(COUNT), force[:, None], {name: values}, AXIS))
            if f.check == "repeated_value"]  # fmt: skip


def lost(values, share, seed=2):
    found, gone = np.array(values), np.random.default_rng(seed).random(COUNT) < share
    for k in range(1, COUNT):
        if gone[k]:
            found[k] = found[k - 1]
    return found


@pytest.mark.parametrize("share", [0.03, 0.15])
def test_values_that_stand_in_for_lost_ones_are_seen(share):
    force, v, q = drive()
    rng = np.random.default_rng(5)
    for name, clean, noise in (("v", v, 0.01), ("q", q, 0.002)):
        (found,) = said(force, lost(np.round(clean + noise * rng.normal(size=COUNT), 7), share), name)
        assert found.column == name and "leave the repeated cells empty" in found.message


def test_what_repeats_by_itself_is_none():
    """No noise; counts, coarse and fine against the noise; a position that creeps by counts; a robot at rest; few digits."""
    force, v, q = drive()
    rng = np.random.default_rng(6)
    noisy = v + 0.01 * rng.normal(size=COUNT)
    for values in (v, noisy, np.round(noisy, 2), np.round(noisy, 3), 0.05 * np.round(v / 0.05)):
        assert not said(force, values)
    for values in (q, 1e-3 * np.round(q / 1e-3), np.round(q + 1e-4 * rng.normal(size=COUNT), 4)):
        assert not said(force, values, "q")
    assert not said(force, np.where(v == 0, 0.0, noisy))


def twice(force, values, **also):
    log = Log.from_arrays("a.csv", DT * np.arange(len(force)), force[:, None], {"v": values, **also}, AXIS)
    return [f for f in preflight(log) if f.check == "repeated_stretch"]


def test_a_stretch_that_stands_twice_is_said_with_its_rows():
    force, v, _ = drive()
    noisy = v + 0.01 * np.random.default_rng(6).normal(size=COUNT)
    rows = np.concatenate([np.arange(420), np.arange(300, COUNT)])
    (found,) = twice(force[rows], noisy[rows])
    assert found.sample == 420 and "rows 420 to 539" in found.message and "from row 300 on" in found.message
    # At standstill, in counts, and where a motion without noise repeats itself, numbers come again.
    assert not twice(force, noisy) and not twice(np.zeros(COUNT), np.zeros(COUNT))
    assert not twice(force, np.round(v / 0.05) * 0.05)
    time = np.arange(COUNT)
    assert not twice(np.sin(2.0 * np.pi * (time % 50) / 50), np.cos(2.0 * np.pi * (time % 50) / 50))
