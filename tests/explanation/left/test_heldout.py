"""Whether something is missing, asked of models that lack nothing, on short logs and with noise that is not Gaussian."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from jaxid import Axis, Log, LogSet, output_error
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.left.within_errors import within_errors

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


def hand(rng):
    """A joystick: every move is slow, so that the command hardly ever holds still."""
    moves = np.repeat(rng.uniform(-5, 5, SAMPLES // 20), 20)
    return signal.lfilter([0.1], [1.0, -0.9], moves)


def test_where_few_differences_tell_the_noise_its_error_counts(axis_log):
    """Of a hand's commands few samples have none changed near them; the rest of the log does not make the noise known."""
    alarms, known = 0, []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        inputs = np.where(np.arange(SAMPLES) % 60 < 15, 0.0, hand(rng))
        clean = axis_log("check", inputs, position=False, **TRUE)
        log = Log.from_arrays("check", clean.time, clean.inputs, clean.output("v") + white(rng), "axis")
        held = held_out_state(Axis().with_values(**TRUE, offset=0.0), LogSet([log]))
        alarms += not held.adequate
        known.append(abs(held.normalised_rms - 1.0) / held.noise_error)
    assert alarms <= 2  # at 1 % of alarms, more than two come once in a hundred times
    assert 0.4 < np.median(known) < 1.2  # 0.67 of a normal deviation, were nothing but the noise's estimate uncertain


@pytest.mark.parametrize(("off", "expected"), [(3.0, True), (12.0, False)])
def test_a_miss_that_the_standard_errors_let_expect_is_no_gap(axis_log, off, expected):
    """Parameters off by three of their errors move long stretches by a little; off by twelve, the fit is not of this robot."""
    rng = np.random.default_rng(8)

    def log(name, inputs, **numbers):
        clean = axis_log(name, inputs, position=False, **numbers)
        noise = 0.01 * rng.normal(size=SAMPLES)
        return Log.from_arrays(name, clean.time, clean.inputs, clean.output("v") + noise, "axis")

    fitted = LogSet([log("fit", np.repeat(rng.uniform(-5, 5, SAMPLES // 20), 20), **TRUE)])
    fit = output_error(Axis().change("offset", free=False).with_values(**TRUE, offset=0.0), fitted)
    assert fit.judgement.verdict == "sound"
    # Fv off by so many of its errors, and the others as goes with that.
    k = fit.free_names.index("Fv")
    step = off * fit.covariance[k] / fit["Fv"].std_error
    other = {name: fit[name].value + change for name, change in zip(fit.free_names, step, strict=True)}
    logs = LogSet(
        [log(f"check {k}", np.full(SAMPLES, 1.2), **other) for k in range(12)]
    )  # slower than any that was fitted
    state = held_out_state(fit.robot, logs)
    assert state.p_white < 0.005 and not state.adequate
    assert within_errors(fit, logs, state).adequate is expected
    assert not within_errors(replace(fit, judgement=fit.judgement.doubted("Something.")), logs, state).adequate
