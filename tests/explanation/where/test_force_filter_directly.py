"""The filter in NumPy against the compiled one, and the smoother against one large least-squares problem."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Log, LogSet, Parameter, float64
from jaxid.explanation.where import missing_force
from jaxid.explanation.where.force_filter import filtered
from jaxid.explanation.where.force_filter_directly import filtered_directly, smoothed

CHANNELS = Channels(inputs=("u",), outputs=("height",))


def pendulum() -> Custom:
    """Its sensor shows no state as it stands."""
    return Custom(
        dynamics=lambda x, u, p: {"angle": x["speed"], "speed": p["gain"] * u["u"] - 9.0 * jnp.sin(x["angle"])},
        state_names=("angle", "speed"),
        own_channels=CHANNELS,
        table={"gain": Parameter(2.0, free=True)},
        output=lambda x, u, p: {"height": 1.0 - jnp.cos(x["angle"]) + 0.2 * jnp.sin(x["angle"])},
        velocities=("speed",),
    )


def logs_of(channels, count: int = 3, samples: int = 120) -> LogSet:
    rng = np.random.default_rng(3)
    logs = []
    for k in range(count):
        u, y = np.repeat(rng.uniform(-1.0, 1.0, (samples // 10, 1)), 10, axis=0), np.zeros((samples, 1))
        y[:, 0] = 0.3 * np.sin(0.1 * np.arange(samples) + k) + 0.01 * rng.normal(size=samples)
        y[5 + k] = np.nan
        logs.append(Log.from_arrays(f"{k}", 0.02 * np.arange(samples), u, y, channels))
    return LogSet(logs)


@pytest.mark.parametrize("robot", [Axis(), pendulum()], ids=["states", "functions of them"])
def test_the_filter_is_the_compiled_one(robot):
    logs = logs_of(robot.channels)
    with float64():
        task = missing_force._task(robot, logs, None, {})
        asked = task.setting, task.numbers, task.arrays, task.intensity(1.0)
        ours, theirs = filtered_directly(*asked), filtered(*asked[:3], jnp.asarray(asked[3]))
    assert ours is not None
    for found, expected in zip(ours, theirs, strict=True):
        # Where it sticks or slides by a rounding, an axis goes its own way from there on.
        expected = np.asarray(expected)[:, :20]
        np.testing.assert_allclose(found[:, :20], expected, rtol=1e-7, atol=1e-9 * max(np.abs(expected).max(), 1e-9))


def test_the_smoother_is_one_large_least_squares_problem():
    """A linear system with two states, of which the first is measured: all samples at once."""
    rng, T = np.random.default_rng(0), 30
    F, Q, H, R = np.array([[1.0, 0.1], [-0.1, 0.9]]), np.diag([1e-3, 0.04]), np.array([1.0, 0.0]), 0.25
    y, P0 = rng.normal(size=T), np.diag([1.0, 2.0])
    mean, P, kept = np.zeros(2), P0, []
    for k in range(T):
        gain = P @ H / (H @ P @ H + R)
        after, after_P = mean + gain * (y[k] - H @ mean), P - np.outer(gain, H @ P)
        mean, P, cross = F @ after, F @ after_P @ F.T + Q, after_P @ F.T
        kept.append((after, after_P, mean, P, cross))
    means, errors = smoothed(tuple(np.stack(part)[None] for part in zip(*kept, strict=True)))
    rows, targets = (
        [np.concatenate([np.linalg.inv(np.linalg.cholesky(P0)), np.zeros((2, 2 * T))], axis=1)],
        [np.zeros(2)],
    )
    whiten = np.linalg.inv(np.linalg.cholesky(Q))
    for k in range(T):
        row = np.zeros((1, 2 * T + 2))
        row[0, 2 * k : 2 * k + 2] = H / np.sqrt(R)
        step = np.zeros((2, 2 * T + 2))
        step[:, 2 * k : 2 * k + 2], step[:, 2 * k + 2 : 2 * k + 4] = -whiten @ F, whiten
        rows, targets = [*rows, row, step], [*targets, y[k : k + 1] / np.sqrt(R), np.zeros(2)]
    A, b = np.concatenate(rows), np.concatenate(targets)
    expected = np.linalg.lstsq(A, b, rcond=None)[0][: 2 * T].reshape(T, 2)
    deviations = np.sqrt(np.diag(np.linalg.inv(A.T @ A)))[: 2 * T].reshape(T, 2)
    np.testing.assert_allclose(means[0], expected, atol=1e-9)
    np.testing.assert_allclose(errors[0], deviations, rtol=1e-8)
