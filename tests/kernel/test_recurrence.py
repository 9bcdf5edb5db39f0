"""Linear recurrences, held to a loop in Python, under every transformation of JAX's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.effects.actuator.followed import as_a_servo
from jaxid.kernel.recurrence import (
    approached,
    approached_in_numpy,
    clipped,
    clipped_in_numpy,
    limited,
    limited_in_numpy,
    recurrence,
    recurrence_in_numpy,
    saturated,
    saturated_in_numpy,
)


def _loop(keep, new, first):
    x, found = np.array(first), []
    for k, n in zip(np.broadcast_to(keep, new.shape), new, strict=True):
        x = k * x + n
        found.append(x)
    return np.array(found)


@pytest.fixture
def case():
    rng = np.random.default_rng(4)
    return rng.uniform(-1.0, 1.0, (50, 3)), rng.normal(size=(50, 3)), rng.normal(size=3)


def test_values_in_xla_and_in_machine_code(case):
    keep, new, first = case
    with jax.enable_x64(True):
        np.testing.assert_allclose(recurrence(keep, new, first), _loop(keep, new, first), rtol=1e-12)
        np.testing.assert_allclose(
            jax.jit(recurrence)(keep[:, :1], new, first), _loop(keep[:, :1], new, first), rtol=1e-12
        )
    np.testing.assert_allclose(recurrence_in_numpy(keep, new), _loop(keep, new, np.zeros(3)), rtol=1e-12)
    np.testing.assert_allclose(
        recurrence_in_numpy(keep[:, 0], new[:, 0]), _loop(keep, new, np.zeros(3))[:, 0], rtol=1e-12
    )


@pytest.mark.parametrize("moving", [(0,), (1,), (2,), (0, 1, 2)])
def test_derivatives_forwards_and_backwards_are_differences(case, moving):
    rng = np.random.default_rng(5)
    directions = [rng.normal(size=part.shape) if i in moving else np.zeros(part.shape) for i, part in enumerate(case)]
    weights = rng.normal(size=case[1].shape)

    def along(step):
        parts = [p + step * d if i in moving else p for i, (p, d) in enumerate(zip(case, directions, strict=True))]
        return jnp.sum(weights * recurrence(*parts))

    with jax.enable_x64(True):
        wanted = (along(1e-6) - along(-1e-6)) / 2e-6
        forwards = jax.jvp(along, (0.0,), (1.0,))[1]
        backwards = jax.grad(along)(0.0)
    np.testing.assert_allclose([forwards, backwards], wanted, rtol=1e-7)


def test_batches_of_either_part(case):
    keep, new, first = case
    many = np.stack([new, 2.0 * new, -new])
    with jax.enable_x64(True):
        found = jax.vmap(recurrence, (None, 0, None))(keep, many, first)
        np.testing.assert_allclose(found[1], _loop(keep, 2.0 * new, first), rtol=1e-12)
        found = jax.vmap(recurrence, (1, None, 0), 1)(keep, new[:, 0], first)
        np.testing.assert_allclose(found[:, 2], _loop(keep[:, 2], new[:, 0], first[2]), rtol=1e-12)


def _limited(wanted, away, back):
    """Each step in time: towards zero at one rate, and with what is left of the step away from it at the other."""
    x, found = np.zeros(wanted.shape[1:]), []
    for w, a, b in zip(wanted, *(np.broadcast_to(most, wanted.shape) for most in (away, back)), strict=True):
        after = np.empty_like(x)
        for i, (own, goal, up, down) in enumerate(zip(x, w, a, b, strict=True)):
            left = 1.0
            if own * (goal - own) < 0:  # towards zero, as far as it or the goal
                rest = max(abs(own) - left * down, abs(goal) if own * goal > 0 else 0.0)
                left, own = left - (abs(own) - rest) / down, np.sign(own) * rest
            if own * (goal - own) >= 0:
                own += np.clip(goal - own, -left * up, left * up)
            after[i] = own
        x = after
        found.append(x)
    return np.array(found)


@pytest.mark.parametrize("alike", [True, False])
def test_limited_steps_their_derivatives_and_batches(case, alike):
    _, wanted, _ = case
    rng = np.random.default_rng(6)
    most, moves = rng.uniform(0.2, 1.5, (2, 50, 1)), rng.normal(size=(2, 50, 1))
    d_wanted, parts = rng.normal(size=(50, 3)), slice(0, 1) if alike else slice(0, 2)
    both = most[[0, 0]] if alike else most

    def loop(step=0.0):
        return _limited(wanted + step * d_wanted, *(most + step * moves)[[0, 0] if alike else [0, 1]])

    assert np.mean(loop() != wanted) > 0.2 and np.mean(np.sign(loop()[1:]) * np.sign(loop()[:-1]) < 0) > 0.2
    np.testing.assert_allclose(
        limited_in_numpy(wanted, *np.broadcast_to(both, (2, 50, 3))), loop(), rtol=1e-12, atol=1e-14
    )
    with jax.enable_x64(True):
        np.testing.assert_allclose(jax.jit(limited)(wanted, *most[parts]), loop(), rtol=1e-12, atol=1e-14)
        batch = jax.vmap(lambda w: limited(w, *most[parts]))(np.stack([wanted, -wanted]))
        np.testing.assert_allclose(batch[1], -loop(), rtol=1e-12, atol=1e-14)
        moved = jax.jvp(limited, (wanted, *most[parts]), (d_wanted, *moves[parts]))[1]
        backwards = jax.grad(lambda h: jnp.sum(limited(wanted + h * d_wanted, *(most + h * moves)[parts])))(0.0)
    step = 1e-7
    slope = (loop(step) - loop(-step)) / (2 * step)
    np.testing.assert_allclose(moved, slope, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(backwards, np.sum(np.asarray(slope)), rtol=1e-5)


def _approached(wanted, away, back):
    """By a thousand small steps of the differential equation each (Heun), whatever it passes on the way."""
    x, found = np.zeros(wanted.shape[1:]), []
    for w, a, b in zip(wanted, *(np.broadcast_to(rate, wanted.shape) for rate in (away, back)), strict=True):
        for _ in range(1000):
            slope = np.where((w - x) * x >= 0, a, b) * (w - x)
            ahead = x + slope / 1000
            x = x + 0.5 * (slope + np.where((w - ahead) * ahead >= 0, a, b) * (w - ahead)) / 1000
        found.append(x)
    return np.array(found)


def test_unequal_approaches_their_derivatives_and_batches(case):
    _, wanted, _ = case
    wanted = np.where(np.arange(50)[:, None] % 7 == 3, 0.0, wanted)
    rng = np.random.default_rng(6)
    away, back = rng.uniform(0.2, 3.0, (2, 50, 1))
    moves = (rng.normal(size=wanted.shape) * (wanted != 0), *rng.normal(size=(2, 50, 1)))
    found = approached_in_numpy(wanted, *(np.broadcast_to(rate, wanted.shape) for rate in (away, back)))
    np.testing.assert_allclose(found, _approached(wanted, away, back), atol=2e-3)
    assert np.mean(np.sign(found[1:]) * np.sign(found[:-1]) < 0) > 0.2

    def along(h):
        return approached(wanted + h * moves[0], away + h * moves[1], back + h * moves[2])

    step = 1e-6
    with jax.enable_x64(True):
        np.testing.assert_allclose(jax.jit(approached)(wanted, away, back), found, rtol=1e-11, atol=1e-13)
        batch = jax.vmap(lambda w: approached(w, away, back))(np.stack([wanted, -wanted]))
        np.testing.assert_allclose(batch[1], -found, rtol=1e-11, atol=1e-13)
        slope = (along(step) - along(-step)) / (2 * step)
        moved = jax.jvp(along, (0.0,), (1.0,))[1]
        backwards = jax.grad(lambda h: jnp.sum(along(h)))(0.0)
    np.testing.assert_allclose(moved, slope, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(backwards, np.sum(np.asarray(slope)), rtol=1e-5)


def _as_a_servo(wanted, share, most):
    """By a thousand small steps of the differential equation each (Heun), and the mean over every step."""
    x, found, means = np.zeros(wanted.shape[1:]), [], []
    for w, a, m in zip(wanted, *(np.broadcast_to(rate, wanted.shape) for rate in (share, most)), strict=True):
        mean = np.zeros_like(x)
        for _ in range(1000):
            slope = np.clip(a * (w - x), -m, m)
            after = x + 0.5 * (slope + np.clip(a * (w - x - slope / 1000), -m, m)) / 1000
            x, mean = after, mean + 0.5 * (x + after) / 1000
        found.append(x)
        means.append(mean)
    return np.array(found), np.array(means)


def test_a_servo_s_way_its_derivatives_and_batches(case):
    _, wanted, _ = case
    wanted = np.repeat(wanted[::5], 5, axis=0)
    rng = np.random.default_rng(8)
    share, most = rng.uniform(0.2, 3.0, (50, 1)), rng.uniform(0.3, 1.2, (50, 1))
    moves = rng.normal(size=wanted.shape), *rng.normal(size=(2, 50, 1))
    found = saturated_in_numpy(wanted, *(np.broadcast_to(rate, wanted.shape) for rate in (share, most)))
    exact, _ = _as_a_servo(wanted, share, most)
    np.testing.assert_allclose(found, exact, atol=1e-6)

    def along(h):
        return saturated(wanted + h * moves[0], share + h * moves[1], most + h * moves[2])

    step = 1e-6
    with jax.enable_x64(True):
        np.testing.assert_allclose(jax.jit(saturated)(wanted, share, most), found, rtol=1e-11, atol=1e-13)
        batch = jax.vmap(lambda w: saturated(w, share, most))(np.stack([wanted, -wanted]))
        np.testing.assert_allclose(batch[1], -found, rtol=1e-11, atol=1e-13)
        slope = (along(step) - along(-step)) / (2 * step)
        moved = jax.jvp(along, (0.0,), (1.0,))[1]
        backwards = jax.grad(lambda h: jnp.sum(along(h)))(0.0)
        # The same with times in the place of shares of a step: constant ones, as a law has them.
        T, per_unit, dt = 0.03, 0.04, np.full(50, 0.02)
        arrived = as_a_servo(jnp.asarray(wanted), jnp.asarray(dt), T, per_unit)
    np.testing.assert_allclose(moved, slope, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(backwards, np.sum(np.asarray(slope)), rtol=1e-5)
    np.testing.assert_allclose(arrived, _as_a_servo(wanted, 0.02 / T, 0.02 / per_unit)[1], atol=1e-6)


def test_a_play_its_derivatives_and_batches(case):
    _, middle, _ = case
    rng = np.random.default_rng(9)
    half, moves = rng.uniform(0.1, 0.9, (50, 1)), (rng.normal(size=middle.shape), rng.normal(size=(50, 1)))
    low, high = np.broadcast_arrays(middle - half, middle + half)
    found, x = clipped_in_numpy(low, high), np.zeros(3)
    for own, a, b in zip(found, low, high, strict=True):
        x = np.clip(x, a, b)
        np.testing.assert_array_equal(own, x)
    assert 0.05 < np.mean(np.diff(found, axis=0) == 0.0) < 0.9  # it is left where it is, and moved

    def along(h):
        own = half + h * moves[1]
        return clipped(middle + h * moves[0] - own, middle + h * moves[0] + own)

    step = 1e-6
    with jax.enable_x64(True):
        np.testing.assert_array_equal(jax.jit(clipped)(low, high), found)
        batch = jax.vmap(lambda sign: clipped(sign * middle - half, sign * middle + half))(np.array([1.0, -1.0]))
        np.testing.assert_array_equal(batch[1], -found)
        slope = (along(step) - along(-step)) / (2 * step)
        moved = jax.jvp(along, (0.0,), (1.0,))[1]
        backwards = jax.grad(lambda h: jnp.sum(along(h)))(0.0)
    np.testing.assert_allclose(moved, slope, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(backwards, np.sum(np.asarray(slope)), rtol=1e-6)
