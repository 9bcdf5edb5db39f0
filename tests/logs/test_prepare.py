"""jaxid/logs/prepare.py."""

import numpy as np
import pytest

from jaxid.logs import AXIS, Log, LogError, LogSet, prepare

TIME = 0.01 * np.arange(2000)
CLEAN = np.sin(2 * np.pi * 0.5 * TIME)


def _log(values, time=TIME):
    return Log.from_arrays("a.csv", time, np.ones(len(time)), values, AXIS)


def test_outliers_are_found_replaced_and_reported():
    random = np.random.default_rng(1)
    values = CLEAN + 0.01 * random.normal(size=len(TIME))
    places = (100, 731, 732, 1500)
    dirty = values.copy()
    dirty[list(places)] += [2.0, -1.0, -1.5, 0.7]
    log, report = prepare(_log(dirty), trends=False)
    removed = report["a.csv"]["v"].outliers
    assert (
        set(places) <= set(removed) and len(removed) < 12
    )  # four deviations: about one in 10,000 by chance, and bends
    assert np.max(np.abs(log.output("v") - CLEAN)) < 0.1
    np.testing.assert_array_equal(log.inputs, _log(dirty).inputs)


def test_a_clean_column_without_noise_is_left_as_it_is():
    log, report = prepare(_log(CLEAN), trends=False)
    np.testing.assert_array_equal(log.output("v"), CLEAN)
    assert report["a.csv"]["v"].outliers == ()


def test_trend_is_taken_out_with_its_slope():
    log, report = prepare(_log(0.3 * TIME + 2.0), outliers=False)
    assert np.isclose(report["a.csv"]["v"].slope, 0.3)
    np.testing.assert_allclose(log.output("v"), 2.0, atol=1e-12)


def test_filter_keeps_phase_and_removes_what_lies_above_the_cutoff():
    fast = 0.2 * np.sin(2 * np.pi * 20 * TIME)
    log, report = prepare(LogSet([_log(CLEAN + fast)]), outliers=False, trends=False, cutoff_hz=5.0)
    middle = slice(200, -200)
    np.testing.assert_allclose(log[0].output("v")[middle], CLEAN[middle], atol=1e-3)
    assert np.isclose(report["a.csv"]["v"].noise_power, 0.2**2 / 2, rtol=0.02)


def test_filtered_logs_still_obey_a_linear_law():
    """v[k+1] = a v[k] + b u[k] holds between filtered columns as between the raw ones, if both were filtered."""
    rng = np.random.default_rng(2)
    u, v, a, b = np.repeat(rng.choice([-1.0, 1.0], 80), 25), np.zeros(2000), 0.97, 0.05
    for k in range(1999):
        v[k + 1] = a * v[k] + b * u[k]
    log, report = prepare(Log.from_arrays("a.csv", TIME, u, v, AXIS), outliers=False, trends=False, cutoff_hz=5.0)
    seen, driven = log.output("v")[200:-200], log.input("u")[200:-200]
    found = np.linalg.lstsq(np.stack([seen[:-1], driven[:-1]], axis=1), seen[1:], rcond=None)[0]
    np.testing.assert_allclose(found, [a, b], rtol=1e-6)
    raw = np.linalg.lstsq(np.stack([seen[:-1], u[200:-201]], axis=1), seen[1:], rcond=None)[0]
    assert abs(raw[1] / b - 1) > 0.05  # speeds filtered, inputs not
    assert report["a.csv"]["u"].noise_power > 0


def test_nothing_asked_is_nothing_done_and_gaps_survive():
    values = CLEAN.copy()
    values[50:60] = np.nan
    log, report = prepare(_log(values), outliers=False, trends=False)
    np.testing.assert_array_equal(log.output("v"), values)
    assert report["a.csv"]["v"].slope == 0
    assert np.isnan(prepare(_log(values))[0].output("v")[50:60]).all()


@pytest.mark.parametrize(
    ("log", "cutoff", "says"),
    [
        (_log(CLEAN), 60.0, "between 0 and 50 Hz"),
        (_log(np.where(TIME == TIME[9], np.nan, CLEAN)), 5.0, "not measured"),
        (_log(CLEAN, TIME + 0.5 * (TIME > 3)), 5.0, "differ by"),
        (_log(CLEAN[:10], TIME[:10]), 5.0, "too few"),
    ],
)
def test_filters_that_cannot_run_say_why(log, cutoff, says):
    with pytest.raises(LogError, match=says):
        prepare(log, cutoff_hz=cutoff)
