"""Slow noise of a sensor, which a filter takes for a disturbance, beside a motion that is disturbed; simulated by Euler's
method in small steps."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, prediction_error
from jaxid.estimate.prediction_error.beside_output_error import contradiction, noise_instead
from jaxid.simulation.rollout import Integrator

TRUTH = {"M": 1.0, "Fv": 2.0, "Fc": 0.5}
FINE = Integrator(2)


def slow_noise(random, count, size=0.03, correlation=0.9):
    """First-order autoregressive noise of this standard deviation."""
    found = [random.normal()]
    for step in random.normal(size=count - 1):
        found.append(correlation * found[-1] + np.sqrt(1.0 - correlation**2) * step)
    return size * np.array(found)


@pytest.fixture(scope="module")
def slow_sensor(disturbed_axis):
    """Logs of an axis whose motion is not disturbed and whose sensor has slow noise, and their fit."""
    logs = []
    for seed in (11, 12):
        clean = disturbed_axis(seed, q=0.0, r=0.0)
        noise = slow_noise(np.random.default_rng([seed, 1]), len(clean.time))
        logs.append(Log.from_arrays(clean.name, clean.time, clean.inputs, {"v": clean.output("v") + noise}, AXIS))
    return LogSet(logs), prediction_error(Axis(), LogSet(logs), integrator=FINE)


@pytest.mark.slow
def test_slow_noise_of_a_sensor_that_is_taken_for_a_disturbance_is_no_sound_fit(slow_sensor):
    _, fit = slow_sensor
    # What makes it dangerous: the process noise counts as certain.
    assert fit.disturbance.p_value < 1e-6
    assert max(abs(fit[name].value - value) / fit[name].std_error for name, value in TRUTH.items()) > 2.0
    assert fit.judgement.verdict == "poor" and not fit.trustworthy
    assert "Output error makes other numbers" in fit.judgement.sentence and "slow noise of a sensor" in fit.notes[0]


@pytest.mark.slow
def test_innovations_that_follow_the_motion_where_a_free_simulation_leaves_none_of_it_are_noise(
    slow_sensor, disturbed_axis
):
    logs, fit = slow_sensor
    said = noise_instead(fit, logs, "auto", FINE)
    assert "slow noise of a sensor" in said and "output error has" in said and "Fv" in said
    lacking = LogSet([disturbed_axis(31, q=0.0, drag=3.0)])
    assert noise_instead(fit, lacking, "auto", FINE) == ""


@pytest.mark.slow
def test_a_disturbed_motion_is_no_contradiction(disturbed_axis):
    logs = LogSet([disturbed_axis(seed) for seed in (21, 22)])
    fit = prediction_error(Axis(), logs, integrator=FINE)
    assert fit.disturbance.p_value < 1e-6 and fit.judgement.verdict == "sound"
    assert contradiction(fit, logs, "auto", FINE) == ""


@pytest.mark.slow
def test_coloured_innovations_beside_a_residual_that_follows_the_motion_are_a_force_that_is_missing(disturbed_axis):
    """Drag beside disturbances of the motion, taken for more of these."""
    logs = LogSet([disturbed_axis(seed, drag=1.5) for seed in (21, 22)])
    fit = prediction_error(Axis(), logs, integrator=FINE)
    assert fit.judgement.verdict == "poor", fit.judgement.sentence
