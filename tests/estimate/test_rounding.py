"""Average readings of a sensor that rounds, and what rounding leaves along a direction that it looks like."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, output_error
from jaxid.estimate.rounding import less_rounding, mean_reading, noise_below

STEP, SEED = 0.05, 3


@pytest.mark.parametrize("below", [0.05, 0.3, 0.6])
def test_a_mean_reading_is_that_of_many_draws(below):
    rng = np.random.default_rng(SEED)
    values = np.linspace(-0.2, 0.2, 41)
    read = np.round((values + STEP * below * rng.standard_normal((40_000, 1))) / STEP) * STEP
    found = mean_reading(values, read[0], STEP, below)
    np.testing.assert_allclose(found, read.mean(axis=0), atol=5.0 * STEP / 200.0 * max(below, 0.5))
    # Counted from anywhere: the readings say where the multiples are.
    np.testing.assert_allclose(mean_reading(values + 0.02, read[0] + 0.02, STEP, below), found + 0.02, atol=1e-12)


def test_the_noise_below_is_found():
    rng = np.random.default_rng(SEED)
    model = [np.sin(0.01 * np.arange(4000))]
    for below in (0.05, 0.3):
        read = [np.round((model[0] + STEP * below * rng.standard_normal(4000)) / STEP) * STEP]
        assert 0.6 * below < noise_below(model, read, STEP) < 1.6 * below


def test_what_rounding_makes_of_slow_signals_is_taken_out_and_nothing_of_fine_ones():
    rng = np.random.default_rng(SEED)
    signal = [0.06 * np.sin(0.01 * np.arange(2000) + k) for k in range(2)]
    noise = [0.2 * STEP * rng.standard_normal(2000) for _ in signal]
    coarse = [np.round((y + n) / STEP) * STEP for y, n in zip(signal, noise, strict=True)]
    errors = [y - read for y, read in zip(signal, coarse, strict=True)]
    left = less_rounding(signal, errors, STEP)
    slow = [np.std(np.concatenate(own).reshape(-1, 40).mean(axis=1)) for own in (errors, left)]
    assert slow[1] < 0.55 * slow[0]
    for step in (0.0, 0.05 * STEP):  # none, and one that the noise hides
        assert all(a is b for a, b in zip(less_rounding(signal, noise, step), noise, strict=True))


@pytest.mark.slow
def test_speeds_of_a_few_steps_of_a_coarse_encoder_are_fitted_without_bias():
    """An axis with dry friction in steps of a millisecond, its complete model fitted to speeds that are rounded to ten times
    their noise: plain least squares takes the friction for several standard errors too large, and such fits are poor."""
    fits = [output_error(AXIS_MODEL, _coarse(seed)) for seed in range(6)]
    off = [[(fit[name].value - value) / fit[name].std_error for name, value in TRUE.items()] for fit in fits]
    assert np.all(np.abs(np.mean(off, axis=0)) < 1.0) and np.all(np.abs(off) < 3.0)
    assert all(fit.judgement is not None and fit.judgement.trustworthy for fit in fits)


def test_what_noise_hides_of_rounding_changes_no_fit():
    fits = [output_error(AXIS_MODEL, _coarse(0, below=0.8)), output_error(AXIS_MODEL, _coarse(0, below=0.1))]
    assert [fit.standard_errors for fit in fits] == ["white", "robust"]


TRUE = {"M": 15.0, "Fv": 14.0, "Fc": 9.0}
AXIS_MODEL = Axis().with_values(**TRUE)


def _coarse(seed: int, below: float = 0.1) -> LogSet:
    rng, logs = np.random.default_rng(seed), []
    for k in range(3):
        force = np.repeat(rng.uniform(-13.0, 13.0, 40), 500)
        v, found = 0.0, np.empty(len(force))
        for i, push in enumerate(force):
            found[i] = v
            free = v + 1e-3 * (push - 14.0 * v) / 15.0
            v = np.sign(free) * max(abs(free) - 1e-3 * 9.0 / 15.0, 0.0)
        read = np.round((found[::20] + below * STEP * rng.standard_normal(len(found[::20]))) / STEP) * STEP
        u = force[::20]
        logs.append(Log.from_arrays(f"{k}", 0.02 * np.arange(len(u)), u[:, None], {"v": read}, AXIS))
    return LogSet(logs)
