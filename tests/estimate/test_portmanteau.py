"""Tests of residuals hold their level on noise as sensors make it, and see what is no noise."""

import numpy as np
import pytest
from scipy import signal

from jaxid._distributions import chi_squared_tail
from jaxid.estimate.jumps import jumping, without_jumps
from jaxid.estimate.portmanteau import forgotten, robust_portmanteau, steadiness

SAMPLES, DRAWS, LEVEL = 800, 300, 0.01
MOST = 8
"""Rejections of 300 at one in a hundred: more come by chance once in two hundred times."""


def gaussian(rng):
    return rng.normal(size=SAMPLES)


def student(rng):
    return rng.standard_t(3, size=SAMPLES)


def twin_outliers(rng):
    found = rng.normal(size=SAMPLES)
    found[200:202] = 40.0
    return found


def louder_in_motion(rng):
    return rng.normal(size=SAMPLES) * (1.0 + 3.0 * (np.arange(SAMPLES) // 40 % 2))


def averaged(rng):
    return np.convolve(rng.normal(size=SAMPLES + 3), np.ones(4), "valid")


def first_order(rng):
    return signal.lfilter([1.0], [1.0, -0.8], rng.normal(size=SAMPLES + 100))[100:]


def low_passed(rng):
    numerator, denominator = np.asarray(signal.butter(2, 0.2))
    return signal.lfilter(numerator, denominator, rng.normal(size=SAMPLES + 100))[100:]


def rejected(test, make):
    """Rejections of two logs of another size each."""
    rng = np.random.default_rng(3)
    return sum(test([make(rng), 3.0 * make(rng)]) < LEVEL for _ in range(DRAWS))


def whiteness(parts):
    return chi_squared_tail(*robust_portmanteau(parts, 20))


@pytest.mark.parametrize("make", [gaussian, student, twin_outliers, louder_in_motion])
def test_white_noise_of_any_size_and_tail_is_white(make):
    assert rejected(whiteness, make) <= MOST


@pytest.mark.parametrize("make", [averaged, first_order, low_passed])
def test_coloured_noise_is_not_white(make):
    assert rejected(whiteness, make) == DRAWS


@pytest.mark.parametrize("make", [gaussian, student, averaged, first_order, low_passed])
def test_steady_noise_has_no_bursts(make):
    assert rejected(lambda parts: steadiness(parts, 25), make) <= MOST


def test_outliers_on_coloured_noise_are_no_bursts_but_motion_is():
    def with_outliers(rng):
        return first_order(rng) + np.where(rng.random(SAMPLES) < 0.01, 40.0, 0.0)

    def in_motion(rng):
        return first_order(rng) * (1.0 + 3.0 * (np.arange(SAMPLES) // 80 % 2))

    assert rejected(lambda parts: steadiness(parts, 25), with_outliers) <= 2 * MOST
    assert rejected(lambda parts: steadiness(parts, 25), in_motion) == DRAWS


@pytest.mark.parametrize("make", [gaussian, averaged, low_passed])
def test_an_average_over_few_samples_is_forgotten(make):
    assert rejected(lambda parts: forgotten(parts, 12, 20), make) <= MOST


def test_slow_noise_is_not_forgotten_soon():
    def slow(rng):
        return signal.lfilter([1.0], [1.0, -0.97], rng.normal(size=SAMPLES + 300))[300:]

    assert rejected(lambda parts: forgotten(parts, 12, 20), slow) > 0.9 * DRAWS


def test_missing_samples_and_nothing_at_all_are_no_evidence():
    rng = np.random.default_rng(0)
    holed = np.where(rng.random(SAMPLES) < 0.3, np.nan, rng.normal(size=SAMPLES))
    assert whiteness([holed]) > LEVEL and steadiness([holed], 25) > LEVEL
    assert robust_portmanteau([np.zeros(50)], 20) == (0.0, 0)
    assert steadiness([np.zeros(10)], 25) == 1.0 and forgotten([np.zeros(10)], 12, 20) == 0.0


def test_jumps_are_what_comes_back_and_not_what_moves():
    rng = np.random.default_rng(1)
    smooth = 20.0 * np.sin(np.arange(SAMPLES) / 30.0) + rng.normal(size=SAMPLES)
    jumped = smooth.copy()
    jumped[[100, 300, 301]] += 200.0
    # In units of the noise, which is known here.
    assert not jumping(smooth, least=1.0).any()
    assert np.flatnonzero(jumping(jumped, least=1.0)).tolist() == [100, 300, 301]
    assert np.abs(without_jumps(jumped) - smooth).max() < 10.0
    assert without_jumps(smooth) is smooth
