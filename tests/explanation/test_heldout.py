"""Whether something is missing, asked of models that lack nothing, on short logs and with noise that is not Gaussian."""

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet
from jaxid.explanation.heldout import held_out_state

TRUE = {"M": 1.0, "Fv": 2.0, "Fc": 0.5}
SAMPLES = 300


def white(rng):
    return 0.01 * rng.normal(size=SAMPLES)


def heavy_tailed(rng):
    return 0.01 * rng.standard_t(3, size=SAMPLES)


def with_outliers(rng):
    return white(rng) + np.where(rng.random(SAMPLES) < 0.01, 0.2 * rng.normal(size=SAMPLES), 0.0)


def held(axis_log, noise, seed, **hidden):
    rng = np.random.default_rng(seed)
    clean = axis_log("check", np.repeat(rng.uniform(-5, 5, SAMPLES // 20), 20), position=False, **{**TRUE, **hidden})
    log = Log.from_arrays("check", clean.time, clean.inputs, clean.output("v") + noise(rng), "axis")
    return held_out_state(Axis().with_values(**TRUE, offset=0.0), LogSet([log]))


@pytest.mark.parametrize("noise", [white, heavy_tailed, with_outliers])
def test_complete_models_raise_no_alarm_on_short_logs(axis_log, noise):
    """The noise is known from 300 samples to 7 % only. (At 1 % of alarms, more than one in 30 comes 4 times in 100.)"""
    assert sum(not held(axis_log, noise, seed).adequate for seed in range(30)) <= 1


def test_a_gap_as_large_as_the_noise_is_seen_on_a_short_log(axis_log):
    assert not any(held(axis_log, white, seed, Fv=2.03).adequate for seed in range(10))
