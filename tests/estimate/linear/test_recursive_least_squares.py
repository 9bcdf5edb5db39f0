"""Recursive least squares against batch solutions by NumPy and by the integral estimator's own solver."""

import time

import jax
import numpy as np
import pytest

from jaxid import Axis, DifferentialDrive, Log, float64
from jaxid.estimate.linear.recursive_least_squares import RecursiveLeastSquares, recursive_least_squares
from jaxid.estimate.linear.weighted_least_squares import solve_by_qr
from jaxid.estimate.linear.window_equations import window_equations
from tests.two_sides import BEFORE, HALF_TRACK, driven


def random_equations(rows=60, n=4, seed=1):
    rng = np.random.default_rng(seed)
    F = rng.standard_normal((rows, n)) * [1.0, 1e-3, 50.0, 1.0]
    theta = np.array([0.3, 400.0, -0.02, 1.5])
    return F, F @ theta + 0.1 * rng.standard_normal(rows)


def test_last_estimate_is_the_batch_result():
    F, y = random_equations()
    state, history, errors = recursive_least_squares(F, y)
    expected = np.linalg.lstsq(F, y, rcond=None)[0]
    residuals = y - F @ expected
    covariance = residuals @ residuals / (len(y) - 4) * np.linalg.inv(F.T @ F)
    np.testing.assert_allclose(np.asarray(state.theta), expected, rtol=1e-10)
    np.testing.assert_allclose(np.asarray(state.covariance), covariance, rtol=1e-8)
    np.testing.assert_allclose(np.asarray(errors[-1]), np.sqrt(np.diag(covariance)), rtol=1e-8)
    assert float(state.count) == len(y)
    for k in (4, 20, 59):  # any moment of the history is the batch result of the equations so far
        np.testing.assert_allclose(
            np.asarray(history[k]), np.linalg.lstsq(F[: k + 1], y[: k + 1], rcond=None)[0], rtol=1e-7
        )


def test_undetermined_until_there_are_enough_equations():
    F, y = random_equations()
    _, history, errors = recursive_least_squares(F, y)
    assert np.isnan(np.asarray(history[:3])).all() and np.isnan(np.asarray(errors[:3])).all()
    assert np.isfinite(np.asarray(history[3:])).all()


def test_blocks_and_padding_change_nothing():
    F, y = random_equations()
    blocks_F, blocks_y = np.zeros((6, 13, 4)), np.zeros((6, 13))
    blocks_F[:, :10], blocks_y[:, :10] = F.reshape(6, 10, 4), y.reshape(6, 10)
    one, _, _ = recursive_least_squares(F, y)
    padded, _, _ = recursive_least_squares(blocks_F, blocks_y)
    np.testing.assert_allclose(np.asarray(padded.theta), np.asarray(one.theta), rtol=1e-10)
    assert float(padded.count) == 60


def test_forgetting_is_exponential_weighting():
    F, y = random_equations()
    state, _, _ = recursive_least_squares(F, y, forgetting=0.9)
    root = np.sqrt(0.9) ** np.arange(len(y))[::-1]
    np.testing.assert_allclose(
        np.asarray(state.theta), np.linalg.lstsq(F * root[:, None], y * root, rcond=None)[0], rtol=1e-9
    )


def test_prior_is_a_ridge():
    F, y = random_equations(rows=2)
    mean, std = np.array([0.2, 300.0, 0.0, 1.0]), np.array([0.1, 50.0, 0.01, 0.3])
    state = RecursiveLeastSquares.start(4, mean, std).update(F, y)
    A, b = np.concatenate([F, np.diag(1 / std)]), np.concatenate([y, mean / std])
    np.testing.assert_allclose(np.asarray(state.theta), np.linalg.lstsq(A, b, rcond=None)[0], rtol=1e-10)


def test_reproduces_integral_least_squares_on_line():
    rng = np.random.default_rng(3)
    time = 0.02 * np.arange(600)
    u = np.repeat(rng.uniform(-8, 8, 20), 30)
    v = np.zeros(600)
    for k in range(599):  # any motion will do: both estimators see the same equations
        v[k + 1] = v[k] + 0.02 * (u[k] - 2 * v[k] - 0.5 * np.sign(v[k])) / 1.5
    log = Log.from_arrays("run", time, u, v + 0.01 * rng.standard_normal(600), Axis())
    equations = window_equations(Axis(), [log], "momentum")
    batch, _, _ = solve_by_qr(equations.regressors, equations.targets)
    state, history, _ = recursive_least_squares(equations.regressors, equations.targets)
    np.testing.assert_allclose(np.asarray(state.theta), np.asarray(batch), rtol=1e-9)
    np.testing.assert_allclose(np.asarray(batch), [1.5, 2.0, 0.5, 0.0], atol=0.1)
    assert np.nanstd(np.asarray(history)[-100:, 0]) < np.nanstd(np.asarray(history)[:200, 0])


def test_equations_as_they_came_are_in_time_independent_and_of_one_noise():
    """Of a cart, whose speed leaves an error of another size than its yaw rate; with the last seconds alone."""
    robot = DifferentialDrive().with_values(b=HALF_TRACK)
    equations = window_equations(robot, driven(3))
    F, y = equations.as_they_came()
    assert len(y) == len(equations) - len(np.unique(equations.stretch))
    _, history, errors = recursive_least_squares(F, y, forgetting=0.995)
    for name, value, error in zip(equations.names, history[-1], errors[-1], strict=True):
        true = BEFORE.get(name, 0.0)
        assert abs(value - true) < 3.0 * error < 0.15 * max(abs(true), 1.0), name
    left = y - F @ np.linalg.lstsq(F, y, rcond=None)[0]
    assert np.std(left) == pytest.approx(1.0, abs=0.05)
    plain = equations.targets - equations.regressors @ history[-1]
    sizes = [np.std(plain[equations.equation == k]) for k in (0, 1)]
    assert max(sizes) > 3.0 * min(sizes)


def test_what_they_say_is_what_the_stretches_say():
    """Helmert's contrasts are rows of an orthogonal matrix without the one of the mean."""
    rng = np.random.default_rng(2)
    u, v = np.repeat(rng.uniform(-4, 4, 20), 15), np.cumsum(0.05 * rng.normal(size=300))
    equations = window_equations(
        Axis(), [Log.from_arrays("run", 0.02 * np.arange(300), u[:, None], v[:, None], Axis())]
    )
    F, y = equations.as_they_came()
    scale = (F.T @ F)[0, 0] / (equations.regressors.T @ equations.regressors)[0, 0]
    np.testing.assert_allclose(F.T @ F, scale * equations.regressors.T @ equations.regressors, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(F.T @ y, scale * equations.regressors.T @ equations.targets, rtol=1e-9, atol=1e-9)


def test_traced_and_plain_numbers_agree():
    F, y = random_equations()
    mean, std = [0.2, 300.0, 0.0, 1.0], [0.1, 50.0, 0.01, 0.3]

    def last(F, y):
        state = RecursiveLeastSquares.start(4, mean, std).update(F[:30], y[:30], 0.95).update(F[30:], y[30:], 0.95)
        return state.theta, state.covariance, state.count

    def history(F, y):
        return recursive_least_squares(F, y, forgetting=0.97)[1:]

    with float64():
        traced = jax.jit(last)(F, y), jax.jit(history)(F, y)
    for found, expected in zip(jax.tree.leaves((last(F, y), history(F, y))), jax.tree.leaves(traced), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_an_update_takes_microseconds():
    F, y = random_equations(rows=3_000)
    begun = time.process_time()
    recursive_least_squares(F, y)
    assert time.process_time() - begun < 3_000 * 300e-6  # measured: 20 microseconds


def test_lanes():
    pairs = [random_equations(seed=seed) for seed in range(3)]
    F, y = (np.stack(column) for column in zip(*pairs, strict=True))
    with float64():
        lanes = jax.vmap(lambda a, b: RecursiveLeastSquares.start(4).update(a, b).theta)(F, y)
    for k in range(3):
        np.testing.assert_allclose(np.asarray(lanes[k]), np.linalg.lstsq(F[k], y[k], rcond=None)[0], rtol=1e-9)


def test_bad_input():
    F, y = random_equations()
    with pytest.raises(ValueError, match="do not fit"):
        recursive_least_squares(F, y[:-1])
    with pytest.raises(ValueError, match="forgetting factor of 1.5"):
        recursive_least_squares(F, y, forgetting=1.5)
    with pytest.raises(TypeError, match=r"window_equations\(robot, logs\)"):
        recursive_least_squares(Axis(), y)
