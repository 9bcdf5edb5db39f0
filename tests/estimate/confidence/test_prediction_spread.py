"""What standard errors let expect of held-out logs: a drive axis in closed form."""

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, compare, output_error, prediction_error

ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.5, offset=0.0).change("offset", free=False).change("Fc", free=False)


def levels(seed, size, n=300):
    return np.repeat(np.random.default_rng(seed).uniform(-size, size, n // 20), 20)


@pytest.fixture(scope="module")
def weak(axis_log):
    """Fitted to motion that hardly stands out of its noise."""
    return LogSet([axis_log("weak", levels(1, 1.2), noise=0.05, seed=1, position=False)])


def said(fit, held_out, fitted):
    return " ".join(note for note in compare(fit, held_out=held_out, fit=fitted).notes if "held-out logs by" in note)


def test_a_miss_that_the_covariance_explains_says_so_and_what_the_logs_do_not_cover(weak, axis_log):
    held_out = LogSet([axis_log("strong", levels(2, 6), noise=0.005, seed=2, position=False)])
    fit = output_error(ROBOT, weak)
    text = said(fit, held_out, weak)
    assert fit.trustworthy and "let expect" in text and "goes from" in text


def test_a_robot_that_has_changed_is_beyond_what_standard_errors_explain(axis_log):
    fitted = LogSet([axis_log("light", levels(3, 4), noise=0.01, seed=3, position=False)])
    fit = output_error(ROBOT, fitted)
    laden = LogSet([axis_log("laden", levels(4, 4), noise=0.01, seed=4, position=False, M=1.5)])
    assert "standard errors explain" in said(fit, laden, fitted) and "columns" not in said(fit, laden, fitted)
    clean = axis_log("turned", levels(4, 4), noise=0.01, seed=4, position=False)
    turned = LogSet([Log.from_arrays("turned", clean.time, clean.inputs, -clean.output("v"), "axis")])
    assert "Check their columns first" in said(fit, turned, fitted)
    same = LogSet([axis_log("same", levels(4, 4), noise=0.01, seed=4, position=False)])
    assert said(fit, same, fitted) == ""


def test_a_few_samples_that_are_far_off_are_no_robot_that_has_changed(axis_log):
    fitted = LogSet([axis_log("fitted", levels(3, 4), noise=0.01, seed=3, position=False)])
    fit = output_error(ROBOT, fitted)
    clean = axis_log("held", levels(4, 4), noise=0.01, seed=4, position=False)
    v = clean.output("v").copy()
    v[[40, 41, 170, 250]] += 1.0
    spiked = LogSet([Log.from_arrays("held", clean.time, clean.inputs, v, "axis")])
    (text,) = [note for note in compare(fit, held_out=spiked, fit=fitted).notes if "held-out logs" in note]
    assert "A few samples make the error" in text and "explain" not in text
    assert float(text.partition("misses by ")[2].split()[0]) < 1.2


def disturbed(seed, M=1.0, q=0.08, n=300, dt=0.02, fine=20):
    """M v' = u - Fv v - Fc sgn v with disturbances of the motion, by Euler and Maruyama."""
    rng, h, v, speeds = np.random.default_rng(seed), dt / fine, 0.0, []
    u = levels(seed, 4, n)
    for force in u:
        speeds.append(v)
        for _ in range(fine):
            v += h * (force - 2.0 * v) / M + q * np.sqrt(h) * rng.normal()
            v = np.sign(v) * max(abs(v) - h * 0.5 / M, 0.0)
    measured = np.array(speeds) + 0.01 * rng.normal(size=n)
    return LogSet([Log.from_arrays(f"log {seed}", dt * np.arange(n), u[:, None], measured, "axis")])


@pytest.mark.slow
def test_what_a_free_simulation_of_the_fitted_logs_misses_as_much_is_no_news():
    """A disturbed motion wanders off every free simulation; prediction error knows that, and its parameters are right."""
    fitted, held_out = disturbed(5), disturbed(6)
    fit = prediction_error(ROBOT, fitted)
    found = compare(fit, held_out=held_out, fit=fitted)
    assert fit.trustworthy and found.predicted[fit.method].normalised_rms > 1.5
    assert said(fit, held_out, fitted) == ""
    # One sample ahead nothing but noise is left, as of a free simulation it is not.
    (ahead,) = found.tested.values()
    assert not ahead.tests["v"].whiteness.rejected and found.predicted[fit.method].tests["v"].whiteness.rejected
