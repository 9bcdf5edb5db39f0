"""jaxid/estimate/robust_covariance.py: intervals against the scatter of many fits, for white and for coloured residuals."""

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, output_error
from jaxid.estimate.output_error.robust_covariance import Robust, memory, stationary
from jaxid.estimate.uncertainty import spread

TRUE = {"M": 1.0, "Fv": 2.0, "Fc": 0.5}
ROBOT = Axis().change("offset", free=False).with_values(**TRUE)
RUNS = 24


def coloured(rng, shape, rho):
    """AR(1) noise of unit variance along the last axis."""
    noise = rng.normal(size=shape)
    for t in range(1, shape[-1]):
        noise[..., t] = rho * noise[..., t - 1] + np.sqrt(1 - rho**2) * noise[..., t]
    return noise


def fits(axis_log, rho, covariance, runs=RUNS):
    inputs = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5], 100)
    clean = [axis_log(f"run {k}", np.roll(inputs, 100 * k), position=False, **TRUE) for k in range(2)]
    rng = np.random.default_rng(8)
    found = []
    for _ in range(runs):
        logs = []
        for log in clean:
            v = log.output("v") + 0.01 * coloured(rng, (len(log),), rho)
            logs.append(Log.from_arrays(log.name, log.time, log.inputs, {"v": v}, log.channels))
        found.append(output_error(ROBOT, LogSet(logs), covariance=covariance))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.8, 0.0])
def test_errors_are_the_scatter_of_the_estimates(axis_log, rho):
    found = fits(axis_log, rho, "robust")
    for name, true in TRUE.items():
        values = np.array([fit[name].value for fit in found])
        errors = np.array([fit[name].std_error for fit in found])
        # The scatter of 24 fits is itself known to a seventh.
        assert np.sqrt(np.mean(errors**2)) == pytest.approx(np.std(values, ddof=1), rel=0.3)
        inside = np.mean(np.abs(values - true) < 1.96 * errors)
        assert inside >= 0.85


def test_the_white_errors_are_too_small_by_what_the_residual_remembers(axis_log):
    (white,), (robust,) = fits(axis_log, 0.8, "white", runs=1), fits(axis_log, 0.8, "robust", runs=1)
    for name in TRUE:
        assert white[name].value == pytest.approx(robust[name].value, rel=1e-9)
        assert 1.5 < robust[name].std_error / white[name].std_error < 4.5  # sqrt((1 + 0.8) / (1 - 0.8)) = 3


def test_memory_of_known_processes():
    rng = np.random.default_rng(3)
    mask = np.ones((4, 20000, 1), dtype=bool)
    assert memory(rng.normal(size=mask.shape), mask) == pytest.approx(1.0, abs=0.1)
    slow = coloured(rng, (4, 20000), 0.8)[..., None]
    assert memory(slow, mask) == pytest.approx(1.8 / 0.2, rel=0.1)
    assert memory(0.0 * slow, mask) == 1.0


def together(axis_log, masses, seed):
    """Six logs of axes of these masses with coloured noise, fitted as one axis."""
    rng = np.random.default_rng(seed)
    inputs, logs = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5], 50), []
    for k, mass in enumerate(masses):
        log = axis_log(f"run {k}", np.roll(inputs, 50 * k), position=False, **(TRUE | {"M": mass}))
        v = log.output("v") + 0.01 * coloured(rng, (len(log),), 0.7)
        logs.append(Log.from_arrays(log.name, log.time, log.inputs, {"v": v}, log.channels))
    return output_error(ROBOT, LogSet(logs))


@pytest.mark.parametrize("rho", [0.8, 0.98, 0.99])
def test_errors_of_a_linear_regression_in_noise_however_slow(rho):
    """Two logs of 400 samples; the slowest noise has a correlation time of half a log."""
    rng = np.random.default_rng(4)
    swing, steps = np.sin(0.04 * np.arange(400) + [[0.0], [1.0]]), np.repeat(rng.normal(size=(2, 20)), 20, axis=1)
    jacobian = np.stack([swing, steps], axis=-1)
    inverse = np.linalg.inv(np.einsum("eti,etj->ij", jacobian, jacobian))
    mask, estimates, variances = np.ones((2, 400, 1), dtype=bool), [], []
    for noise in coloured(rng, (200, 2, 400), rho):
        estimates.append(inverse @ np.einsum("eti,et->i", jacobian, noise))
        residual = (noise - jacobian @ estimates[-1])[..., None]
        variances.append(np.diag(inverse @ stationary(residual, jacobian[:, :, None], mask, inverse) @ inverse))
    ratio = np.sqrt(np.mean(variances, axis=0)) / np.std(estimates, axis=0)
    assert np.all((ratio > 0.85) & (ratio < 1.6)), ratio


def test_logs_of_different_robots_widen_the_standard_errors_and_those_of_one_robot_do_not(axis_log):
    masses = [0.85, 1.1, 0.95, 1.15, 0.9, 1.05]
    one, many = together(axis_log, [1.0] * 6, 5), together(axis_log, masses, 5)
    assert not any("disagree" in note for note in one.notes)
    assert any("The 6 logs disagree" in note and "in M" in note for note in many.notes)
    # The mean of six masses is known to their scatter over the root of six.
    assert many["M"].std_error == pytest.approx(np.std(masses, ddof=1) / np.sqrt(6), rel=0.5)
    assert many["M"].std_error > 3 * one["M"].std_error


def test_what_normal_equations_lose_in_rounding_has_the_errors_of_white_residuals():
    """Two parameters of which one column of the Jacobian is the other but for 1e-8: nothing in its square, known in itself."""
    rng = np.random.default_rng(4)
    one, other = rng.normal(size=(2, 300))
    jacobian = np.stack([5.0 * one, 0.2 * (one + 1e-8 * other)], axis=1)
    white = spread(jacobian, np.ones(2, bool), np.full(2, np.inf)).covariance
    unit = 1.0 / np.linalg.norm(jacobian, axis=0)
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian * np.outer(unit, unit))
    found = (vectors[:, 1:] / values[1:]) @ vectors[:, 1:].T * np.outer(unit, unit)
    assert np.sqrt(white[0, 0] / found[0, 0]) > 1e6  # it would be called known
    robust = Robust(found, np.ones(2), vectors[:, :1], unit)
    assert robust.with_lost(white) == pytest.approx(white, rel=1e-6)
