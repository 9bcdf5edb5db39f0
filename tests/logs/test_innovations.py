"""jaxid/logs/innovations.py: the noise of readings between which a robot moves far, an axis with dry friction in SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import Axis, Log, noise_level
from jaxid.logs.innovations import not_foretold

ROW = 0.005


def quick_axis(seconds, seed, constant=0.05):
    """Speed and command of an axis of that time constant [s] that a pseudo-random sequence drives, every 5 ms."""
    rng, rows = np.random.default_rng(seed), round(seconds / ROW)
    u = np.repeat(rng.choice([-1.0, 1.0], rows // 17 + 1), 17)[:rows]  # a clock of 85 ms

    def rate(t, v):
        return (u[min(int(t / ROW), rows - 1)] - v - 0.15 * np.tanh(v / 0.01)) / constant

    solved = solve_ivp(rate, (0.0, rows * ROW), [0.0], t_eval=ROW * np.arange(rows), max_step=ROW / 2, method="LSODA")
    return solved.y[0], u


def log_of(v, u, every=1):
    v = np.where(np.arange(len(v)) % every, np.nan, v)
    return Log.from_arrays("run", ROW * np.arange(len(v)), u[:, None], {"v": v}, Axis())


@pytest.mark.parametrize(("every", "seconds"), [(10, 30.0), (7, 20.0), (10, 5.0)])
def test_motion_between_slow_readings_is_not_their_noise(every, seconds):
    v, u = quick_axis(seconds, 3)
    noise = 0.01
    seen = v + noise * np.random.default_rng(4).normal(size=len(v))
    found = noise_level(log_of(seen, u, every))["v"]
    # The differences of neighbouring readings are some ten times as large.
    assert noise < found < 4.0 * noise


@pytest.mark.parametrize("noise", [0.005, 0.05, 0.3])
def test_where_differences_show_the_noise_they_are_the_noise(noise):
    v, u = quick_axis(30.0, 5, constant=0.3)
    seen = v + noise * np.random.default_rng(6).normal(size=len(v))
    assert noise_level(log_of(seen, u))["v"] == pytest.approx(noise, rel=0.06)
    assert not_foretold(seen, u[:, None]) > 0.98 * noise  # never less


def test_a_counters_differences_are_no_less_than_they_are():
    """What one difference of counts is off by the next one is off by the other way, which an autoregression foretells."""
    v, u = quick_axis(30.0, 7, constant=0.3)
    step = 0.002
    counts = np.round(ROW * np.cumsum(v) / step + 0.3)
    seen = np.diff(counts, prepend=counts[0]) * step / ROW
    true = step / ROW / np.sqrt(6.0)
    assert noise_level(log_of(seen, u))["v"] > 0.9 * true


def test_too_few_readings_tell_nothing():
    assert not_foretold(np.ones(6), np.ones((6, 1))) == np.inf
    assert not_foretold(np.r_[np.full(40, np.nan), np.ones(4)], np.ones((44, 1))) == np.inf
