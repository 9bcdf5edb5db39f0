"""jaxid/logs/combine.py: nothing is invented, nothing is lost, and commands act for as long as they did."""

import numpy as np
import pytest

from jaxid.logs import LogError
from jaxid.logs.combine import NEAR, Signal, combine, held

MS = 1_000_000


def signal(milliseconds, values=None):
    time = np.round(np.asarray(milliseconds, dtype=float) * MS).astype(np.int64)
    return Signal(time, np.arange(float(len(time))) if values is None else np.asarray(values, dtype=float))


def checks(rows):
    return {check: text for _, check, _, text in rows.notes}


def test_a_command_between_two_measurements_has_a_row_of_its_own():
    volts = signal([-5, 33, 70], [1.0, 2.0, 3.0])
    speed = signal([0, 20, 40, 60, 80])
    rows = combine({"u": volts}, {"v": speed}, {"v"})
    np.testing.assert_allclose(rows.time, np.array([0, 20, 33, 40, 60, 70, 80]) * 1e-3)
    np.testing.assert_array_equal(rows.inputs["u"], [1, 1, 2, 2, 2, 3, 3])
    np.testing.assert_array_equal(rows.outputs["v"], [0, 1, np.nan, 2, 3, np.nan, 4])


def test_channels_of_one_clock_and_its_commands_stay_a_table():
    """No clock but one: the rows are the samples, and nothing is said."""
    time = [0, 20, 40, 60]
    rows = combine({"u": signal(time)}, {"v": signal(time), "w": signal(time)}, {"v", "w"})
    np.testing.assert_array_equal(rows.time, np.array(time) * 1e-3)
    np.testing.assert_array_equal(rows.inputs["u"], np.arange(4))
    assert rows.notes == ()


@pytest.mark.parametrize("seed", range(8))
def test_every_sample_is_there_once_at_its_time_and_every_command_acts_as_long_as_it_did(seed):
    rng = np.random.default_rng(seed)
    fast = np.sort(rng.uniform(0, 2000, 400)) if seed % 2 else 5.0 * np.arange(400) + rng.normal(0, 0.02, 400)
    slow = 50.0 * np.arange(40) + rng.uniform(0, 5)
    commands = np.concatenate([[-1.0], np.sort(rng.uniform(0, 1990, 60))])
    u, v, w = signal(commands, rng.normal(size=61)), signal(fast), signal(slow)
    rows = combine({"u": u}, {"v": v, "w": w}, {"v", "w"})
    stamps = rows.begin + np.round(rows.time * 1e9)
    near = NEAR * np.median(np.diff(v.time))
    for name, own in {"v": v, "w": w}.items():
        inside = own.time >= rows.begin
        there = np.isfinite(rows.outputs[name])
        np.testing.assert_array_equal(rows.outputs[name][there], own.values[inside])
        assert np.max(np.abs(stamps[there] - own.time[inside])) <= near + 1
    # The impulse of the held command up to any row, but for what moving by `near` makes of one change.
    exact = np.unique(np.concatenate([u.time[u.time > rows.begin], stamps.astype(np.int64)]))
    exact = exact[exact <= stamps[-1]]
    impulse = np.concatenate([[0.0], np.cumsum(held(u, exact[:-1]) * np.diff(exact))])[np.searchsorted(exact, stamps)]
    found = np.concatenate([[0.0], np.cumsum(rows.inputs["u"][:-1] * np.diff(stamps))])
    assert np.max(np.abs(found - impulse)) <= near * np.sum(np.abs(np.diff(u.values)))
    assert np.all(np.diff(rows.time) > 0)


def test_instants_that_are_nearly_one_share_the_fastest_channels_row():
    gyro = signal(5.0 * np.arange(100))
    wheel = signal(20.0 * np.arange(25) + 0.08)  # 1.6 % of the gyro's interval later
    rows = combine({"u": signal([0.0, 50.05], [1.0, 2.0])}, {"w": gyro, "v": wheel}, {"v", "w"})
    assert len(rows.time) == 100  # the log begins with the first wheel speed, after the first rate
    np.testing.assert_allclose(np.diff(rows.time[1:]), 5e-3)
    assert "'v' is moved by up to 0.08 ms, 1.6% of it" in checks(rows)["moved_samples"]
    at = np.argmax(rows.inputs["u"] == 2.0)
    np.testing.assert_allclose(rows.begin + rows.time[at] * 1e9, 50 * MS)  # the change comes 0.05 ms later


def test_commands_that_change_oftener_than_anything_is_measured_have_their_mean():
    time = np.arange(0.0, 401.0)
    volts = np.sin(time / 30)
    rows = combine({"u": signal(time, volts)}, {"v": signal(20.0 * np.arange(20))}, {"v"})
    assert len(rows.time) == 20 and "mean until the next" in checks(rows)["mean_commands"]
    np.testing.assert_allclose(rows.inputs["u"][:-1], volts[:380].reshape(19, 20).mean(axis=1), atol=1e-12)


def test_a_log_begins_where_everything_is_known():
    rows = combine(
        {"u": signal([1500, 3000])},
        {"v": signal(np.arange(0, 5000, 20.0)), "w": signal(np.arange(2000, 5000, 100.0))},
        {"v", "w"},
    )
    assert rows.begin == 2000 * MS
    assert "the first 2 s are left out, since 'w' begins only then" in checks(rows)["cut_start"]
    # An optional channel may begin later.
    late = {"v": signal(np.arange(0, 5000, 20.0)), "i": signal(np.arange(2000, 5000, 100.0))}
    assert combine({"u": signal([0, 3000])}, late, {"v"}).begin == 0


def test_commands_that_stay_away():
    measured = {"v": signal(np.arange(0, 10_000, 20.0))}
    steady = combine({"u": signal(np.arange(0, 5000, 50.0), np.ones(100))}, measured, {"v"})
    np.testing.assert_allclose(steady.time[-1], 5.1, atol=0.0201)  # three intervals after the last one
    assert "stays away for the last 4.88 s" in checks(steady)["cut_end"]
    # Whoever speaks only when something changes may be silent for long.
    seldom = combine({"u": signal([0, 100, 150, 4000, 4100], [1, 2, 3, 4, 5])}, measured, {"v"})
    np.testing.assert_allclose(seldom.time[-1], 9.98)
    assert "is held for the last 5.88 s" in checks(seldom)["held_to_the_end"]


def test_channels_that_never_meet():
    with pytest.raises(LogError, match="no time in common .*receive"):
        combine({"u": signal([0, 1])}, {"v": signal([0, 1]), "w": signal([5000, 5001])}, {"v", "w"})
