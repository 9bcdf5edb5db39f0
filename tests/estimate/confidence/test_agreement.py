"""How well simulations agree with logs: metrics against closed forms, residual tests against their stated false-alarm rate."""

import numpy as np
import pytest
from scipy import signal

from jaxid.estimate.confidence.agreement import agreement, counted_channels, fit_percent
from jaxid.estimate.residual_tests import FALSE_ALARM, autocorrelation, cross_correlation, normality, whiteness
from jaxid.logs import AXIS, PIONEER, Log, LogSet

SERIES = 200
# 200 tests at 1 %: two alarms expected; more than 7 has probability 0.1 %.
MOST_ALARMS = 7


def _logs(lengths=(4000, 2500), seed=1):
    """Pioneer logs whose "simulation" is known, with white noise of 0.02 m/s and 0.05 rad/s."""
    random = np.random.default_rng(seed)
    logs, truth = [], []
    for i, n in enumerate(lengths):
        t = 0.02 * np.arange(n)
        y = np.stack([np.sin(0.5 * t), 2 * np.cos(0.3 * t)], axis=1)
        inputs = np.repeat(random.choice([-5.0, 5.0], size=(n // 20 + 1, 2)), 20, axis=0)[:n]
        logs.append(Log.from_arrays(f"{i}.csv", t, inputs, y + random.normal(size=y.shape) * (0.02, 0.05), PIONEER))
        truth.append(y)
    return LogSet(logs), truth


NOISE = {"eta1": 0.02, "eta2": 0.05}


def test_a_perfect_model_leaves_the_noise():
    logs, truth = _logs()
    found = agreement(logs, truth, NOISE)
    assert found.normalised_rms == pytest.approx(1.0, rel=0.01)
    assert found.rms["eta1"] == pytest.approx(0.02, rel=0.02)
    assert found.std["eta2"] == pytest.approx(0.05, rel=0.02)
    assert abs(found.mean["eta1"]) < 4 * 0.02 / np.sqrt(6500)
    # |noise| / |signal - mean|: amplitude 1 over many periods has standard deviation 1/sqrt(2).
    assert found.fit_percent["eta1"] == pytest.approx(100 * (1 - 0.02 / np.sqrt(0.5 + 0.02**2)), abs=0.1)
    assert not found.diverged and not any(test.rejected for tests in found.tests.values() for test in tests.all)
    assert all(tests.summary == "" for tests in found.tests.values())


def test_errors_add_to_the_noise_in_quadrature():
    logs, truth = _logs()
    biased = [y + np.array([0.04, 0.0]) for y in truth]
    found = agreement(logs, biased, NOISE)
    assert found.normalised_rms == pytest.approx(np.sqrt((1 + 4 + 1) / 2), rel=0.01)
    assert found.mean["eta1"] == pytest.approx(0.04, rel=0.03)
    assert found.by_log["0.csv"].normalised_rms == pytest.approx(found.normalised_rms, rel=0.02)


def test_fit_percent_closed_forms():
    y = np.array([1.0, 2.0, 3.0, np.nan, 4.0])
    seen = np.isfinite(y)
    assert fit_percent([np.where(seen, 0.0, np.nan)], [y]) == 100.0
    # Predicting the mean explains nothing.
    assert fit_percent([2.5 - y], [y]) == pytest.approx(0.0, abs=1e-12)
    assert fit_percent([0.5 * (2.5 - y)], [y]) == pytest.approx(50.0)
    assert np.isnan(fit_percent([np.zeros(3)], [np.ones(3)]))


@pytest.mark.parametrize("break_it", [np.nan, np.inf, 1e9])
def test_a_diverging_log_is_named_and_leaves_the_others_alone(break_it):
    logs, truth = _logs()
    alone = agreement(logs[:1], truth[:1], NOISE)
    broken = truth[1].copy()
    broken[1000:, 1] = break_it
    found = agreement(logs, [truth[0], broken], NOISE)
    assert found.diverged == ("1.csv",)
    assert found.by_log["1.csv"].diverged and np.isnan(found.by_log["1.csv"].normalised_rms)
    assert found.normalised_rms == alone.normalised_rms
    assert found.fit_percent == alone.fit_percent
    assert found.tests["eta2"].whiteness == alone.tests["eta2"].whiteness


def test_when_every_log_diverges_nothing_is_claimed():
    logs, truth = _logs()
    found = agreement(logs, [np.full_like(y, np.nan) for y in truth], NOISE)
    assert found.diverged == logs.names and np.isnan(found.normalised_rms) and not found.tests


def test_only_measured_channels_count_and_a_position_stands_in_for_a_speed():
    t = 0.01 * np.arange(300)
    nothing = np.full(300, np.nan)
    speed = Log.from_arrays("v.csv", t, np.ones(300), {"v": t, "q": t}, AXIS)
    position = Log.from_arrays("q.csv", t, np.ones(300), {"v": nothing, "q": t}, AXIS)
    assert counted_channels(speed) == ("v",)
    assert counted_channels(position) == ("q",)
    off = np.stack([t + 0.1, t + 0.3], axis=1)
    found = agreement(LogSet([speed, position]), [off, off], {"v": 0.1, "q": 0.1})
    assert found.rms == pytest.approx({"v": 0.1, "q": 0.3})
    assert found.normalised_rms == pytest.approx(np.sqrt((1 + 9) / 2))


def test_autocorrelation_of_a_moving_average_and_never_across_logs():
    e = np.random.default_rng(3).normal(size=100_000)
    y = e[1:] + 0.5 * e[:-1]
    rho, pairs = autocorrelation([y], 3)
    # MA(1) with b = 0.5: rho_1 = b / (1 + b²), zero beyond.
    assert rho == pytest.approx([1.0, 0.4, 0.0, 0.0], abs=4 / np.sqrt(len(y)))
    assert pairs == pytest.approx(len(y) - np.arange(4))
    _, pairs = autocorrelation([y[:50], np.where(np.arange(50) == 20, np.nan, y[:50])], 1)
    assert pairs == pytest.approx([99, 49 + 47])


def test_whiteness_has_the_stated_false_alarm_rate():
    random = np.random.default_rng(11)
    alarms = [whiteness([random.normal(size=700), random.normal(size=500)]).rejected for _ in range(SERIES)]
    assert sum(alarms) <= MOST_ALARMS
    # and its p values are uniform: a tenth below 0.1 (standard deviation 2 %)
    p = [whiteness([random.normal(size=600)]).p_value for _ in range(SERIES)]
    assert np.mean(np.array(p) < 0.1) == pytest.approx(0.1, abs=0.065)


def test_whiteness_with_missing_samples():
    random = np.random.default_rng(12)
    alarms = 0
    for _ in range(SERIES):
        e = random.normal(size=1000)
        e[random.uniform(size=1000) < 0.3] = np.nan
        alarms += whiteness([e]).rejected
    assert alarms <= MOST_ALARMS


def test_coloured_residuals_are_rejected():
    e = np.random.default_rng(13).normal(size=2000)
    found = whiteness([signal.lfilter([1.0], [1.0, -0.3], e)], "eta1")
    assert found.rejected and found.p_value < 1e-10
    assert "eta1" in found.sentence and "lag 1" in found.sentence


def _held(random, n):
    """An input that is held for 25 samples at a time."""
    return np.repeat(random.choice([-1.0, 1.0], size=n // 25 + 1), 25)[:n]


@pytest.mark.parametrize("colour", [0.0, 0.8])
def test_an_unrelated_input_passes_whatever_the_colour_of_the_residual(colour):
    random = np.random.default_rng(21)
    alarms = 0
    for _ in range(SERIES):
        e = signal.lfilter([1.0], [1.0, -colour], random.normal(size=1500))
        test, rho = cross_correlation([e[:800], e[800:]], [_held(random, 800), _held(random, 700)])
        alarms += test.rejected
        assert rho.shape == (26,)
    assert alarms <= MOST_ALARMS


def test_what_an_input_still_explains_is_found_at_its_delay():
    random = np.random.default_rng(22)
    u = random.normal(size=3000)
    e = random.normal(size=3000)
    e[7:] += 0.2 * u[:-7]
    test, rho = cross_correlation([e], [u], "eta2", "V3")
    assert test.rejected and int(np.argmax(np.abs(rho))) == 7
    assert rho[7] == pytest.approx(0.2 / np.sqrt(1.04), abs=4 / np.sqrt(3000))
    assert "V3" in test.sentence and "lag 7" in test.sentence


def test_a_constant_input_is_not_tested_rather_than_passed():
    test, _ = cross_correlation([np.random.default_rng(0).normal(size=500)], [np.full(500, 4.0)], "eta1", "V2")
    assert np.isnan(test.p_value) and not test.rejected and "never changes" in test.sentence


def test_normality():
    random = np.random.default_rng(31)
    assert sum(normality(random.normal(size=1000)).rejected for _ in range(SERIES)) <= MOST_ALARMS
    assert normality(random.uniform(size=1000)).rejected
    spikes = random.normal(size=1000)
    spikes[::50] *= 8
    assert "outliers" in normality(spikes).sentence


@pytest.mark.parametrize("values", [np.zeros(500), np.full(500, np.nan), np.ones(3)])
def test_what_cannot_be_tested_says_so(values):
    values = np.concatenate([values, [0.0]])
    for test in (
        whiteness([values]),
        normality(values),
        cross_correlation([values], [np.arange(len(values)) * 1.0])[0],
    ):
        assert np.isnan(test.p_value) and not test.rejected and "not" in test.sentence
    assert 0 < FALSE_ALARM < 0.05
