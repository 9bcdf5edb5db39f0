"""The colour of noise: made-up noise of known correlation is recognised, whitened, and drawn again."""

import numpy as np
import pytest
from scipy import signal

from jaxid.estimate.noise_colour import Colour, colour_in_stretches, colour_of


def first_order(correlation, samples, rng, start=300):
    """Noise of unit variance whose neighbours have this correlation."""
    white = np.sqrt(1 - correlation**2) * rng.normal(size=samples + start)
    return signal.lfilter([1.0], [1.0, -correlation], white)[start:]


@pytest.mark.parametrize("correlation", [0.5, 0.8, 0.95])
def test_first_order_noise_is_recognised_and_whitened(correlation):
    rng = np.random.default_rng(3)
    parts = [first_order(correlation, 1500, rng) for _ in range(2)]
    found = colour_of(parts)
    assert found.order == 1
    assert found.coefficients[0] == pytest.approx(correlation, abs=4 * np.sqrt((1 - correlation**2) / 3000))
    assert found.correlations[:4] == pytest.approx(found.coefficients[0] ** np.arange(4), abs=1e-9)
    white = found.whiten(parts[0], np.ones(1500, bool))[1:]
    assert white.std() == pytest.approx(1.0, abs=0.1) and abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.1


def test_white_noise_has_no_colour_and_gaps_are_stepped_over():
    rng = np.random.default_rng(4)
    assert colour_of([rng.normal(size=1000)]).order == 0
    # A slow sensor: every fifth sample is measured, and its neighbours are five samples away.
    slow = np.full(5000, np.nan)
    slow[::5] = first_order(0.8, 1000, rng)
    assert colour_of([slow]).coefficients[0] == pytest.approx(0.8, abs=0.06)


@pytest.mark.parametrize("correlation", [0.0, pytest.param(0.5, marks=pytest.mark.slow), 0.95])
def test_it_is_drawn_stationary_from_the_first_sample_on(correlation):
    colour, rng = Colour.first_order(0.3, correlation), np.random.default_rng(5)
    drawn = np.stack([colour.drawn(rng, 20) for _ in range(4000)])
    assert drawn.std(axis=0) == pytest.approx(0.3, rel=0.06)  # a standard deviation of 4,000 is known to 1.1 %
    neighbours = np.mean(drawn[:, 1:] * drawn[:, :-1]) / np.mean(drawn**2)
    assert neighbours == pytest.approx(correlation, abs=0.03)


@pytest.mark.parametrize("correlation", [0.0, 0.8])
def test_stretches_that_have_lost_their_means_still_tell_the_noise(correlation):
    noise = 0.2 * first_order(correlation, 25 * 400, np.random.default_rng(6)).reshape(400, 25)
    residual = (noise - noise.mean(axis=1, keepdims=True)).ravel()
    found = colour_in_stretches([residual], 25)
    assert found.correlation == pytest.approx(correlation, abs=0.06)
    assert found.level / np.sqrt(1 - found.correlation**2) == pytest.approx(0.2, rel=0.1)


def test_after_a_gap_noise_is_another_one_and_a_slow_sensor_has_none():
    """Neighbours across lost rows are less alike: what is left of them would be taken for several times the innovations."""
    colour, random = Colour.first_order(1.0, 0.9), np.random.default_rng(3)
    values, there = colour.drawn(random, 20_000), np.ones(20_000, dtype=bool)
    lost = random.choice(np.arange(10, 19_990, 10), 600, replace=False)
    there[(lost[:, None] + np.arange(4)).ravel()] = False
    white = colour.whiten(np.where(there, values, np.nan), there)
    assert np.all(white[lost + 4] == 0.0) and np.all(white[~there] == 0.0)
    assert np.std(white[white != 0.0]) == pytest.approx(1.0, abs=0.02)
    # Of a sensor that shows every third row those are its neighbours.
    third = np.arange(20_000) % 3 == 0
    assert np.count_nonzero(colour.whiten(values, third)) == np.count_nonzero(third) - 1
