"""jaxid/report/own_clock.py: what a slower sensor of a log leaves is drawn as a line."""

import numpy as np
import pytest

import jaxid
from jaxid.report.comparison_page import response_chart
from jaxid.report.figures import response
from jaxid.report.own_clock import on_own_clock, own_interval, own_rows

FAST = np.arange(200) * 0.005
SLOW = np.where(np.arange(200) % 4 == 0, np.sin(FAST), np.nan)
"""What a sensor of 50 Hz says in the rows of one of 200 Hz."""


def test_rows_of_another_sensor_are_no_gaps():
    x, y = on_own_clock(FAST, SLOW)
    np.testing.assert_array_equal(x, FAST[::4])
    np.testing.assert_array_equal(y, np.sin(FAST[::4]))


def test_a_gap_of_its_own_stays_one():
    values = SLOW.copy()
    values[60:100] = np.nan
    x, y = on_own_clock(FAST, values)
    (at,) = np.flatnonzero(np.isnan(y))
    assert x[at - 1] == FAST[56] and x[at + 1] == FAST[100] and x[at - 1] < x[at] < x[at + 1]


@pytest.mark.parametrize("count", [0, 1, 2])
def test_hardly_anything_measured(count):
    values = np.full(200, np.nan)
    values[:count] = 1.0
    assert len(on_own_clock(FAST, values)[0]) == count


def two_clocks():
    inputs = {"u_right": np.ones(200), "u_left": np.ones(200)}
    outputs = {"v": SLOW, "w": np.cos(FAST)}
    return jaxid.Log.from_arrays("two clocks", FAST, inputs, outputs, jaxid.DifferentialDrive())


def test_the_residual_of_a_slower_sensor_is_a_line_in_chart_and_figure():
    log, noise = two_clocks(), {"v": 0.01, "w": 0.01}
    simulated = {"output_error": np.stack([np.sin(FAST) + 0.01, np.cos(FAST)], axis=1)}
    chart = response_chart(log, simulated, noise, {})
    for panel, samples in zip(chart.drawn[2::2], (50, 200), strict=True):
        ((path, _, style),) = panel.paths
        assert style == "thin" and path.count("M") == 1 and len(path.split("l")[1].split()) == 2 * (samples - 1), (
            panel.title
        )
    figure = response(log, ["v", "w"], simulated, noise, {"output_error": "output error"})
    for ax, samples in zip(figure.axes[2::2], (50, 200), strict=True):
        assert [np.isfinite(line.get_ydata()).sum() for line in ax.lines] == [samples]


def test_neighbours_of_a_sensor_are_its_own():
    rng = np.random.default_rng(4)
    time = np.sort(np.concatenate([FAST, FAST[::4] + 0.0007]))  # a row of its own for every slow sample
    values = np.full(len(time), np.nan)
    at = np.flatnonzero(~np.isin(time, FAST))
    values[at] = rng.normal(size=50)
    interval = own_interval([time], [values])
    assert interval == pytest.approx(0.02)
    np.testing.assert_array_equal(own_rows(time, values, interval), values[at])
    values[at[10]] = np.nan
    rows = own_rows(time, values, interval)
    assert len(rows) == 50 and np.flatnonzero(np.isnan(rows)).tolist() == [10]
    np.testing.assert_array_equal(own_rows(FAST, np.cos(FAST), 0.005), np.cos(FAST))


def test_sensors_that_pause_for_long_are_put_together():
    time = np.concatenate([FAST, 1000.0 + FAST])
    values = np.where(np.arange(400) % 4 == 0, 1.0, np.nan)
    assert len(own_rows(time, values, 0.02)) == 100
