"""Averages over a window: against means worked out by hand, for stamps that are not even."""

import jax
import numpy as np
import pytest

from jaxid import float64
from jaxid.effects.sensor.lag import averaged

AVERAGED = jax.jit(averaged, static_argnums=3)
RNG = np.random.default_rng(3)
TIME = np.concatenate([[0.0], np.cumsum(RNG.uniform(0.01, 0.03, 300))])


def speed(t):
    return np.stack([np.sin(3 * t) + 0.3 * np.cos(11 * t), 0.2 * t**2 - t], axis=-1)


def way(t):
    """Its integral."""
    return np.stack([-np.cos(3 * t) / 3 + 0.3 * np.sin(11 * t) / 11, 0.2 * t**3 / 3 - t**2 / 2], axis=-1)


@pytest.mark.parametrize("ahead", [0.0, 0.5])
@pytest.mark.parametrize("window", [0.04, 0.1, 0.3])
def test_the_mean_over_a_window_is_that_of_the_integral(window, ahead):
    begin, end = TIME - (1 - ahead) * window, TIME + ahead * window
    inside = (begin > TIME[3]) & (end < TIME[-4])
    truth = (way(end) - way(begin)) / window
    with float64():
        found = np.asarray(AVERAGED(speed(TIME), TIME, window, ahead))
    changed = np.abs(truth - speed(TIME))[inside].max(axis=0)
    assert np.all(np.abs(found - truth)[inside].max(axis=0) < 0.2 * changed)


def test_central_differences_of_a_position_are_the_mean_over_two_samples():
    time = 0.02 * np.arange(200)
    central = np.gradient(way(time), time, axis=0)
    with float64():
        found = np.asarray(AVERAGED(speed(time), time, 0.04, 0.5))
    assert np.abs(found - central)[2:-2].max() < 0.05 * np.abs(speed(time) - central)[2:-2].max()


def test_beyond_its_ends_a_record_is_as_it_is_there():
    still = np.full((len(TIME), 1), 2.5)
    with float64():
        for ahead in (0.0, 0.5):
            assert np.allclose(AVERAGED(still, TIME, 0.2, ahead), 2.5)
