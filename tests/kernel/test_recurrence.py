"""Linear recurrences, held to a loop in Python, under every transformation of JAX's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.kernel.recurrence import limited, limited_in_numpy, recurrence, recurrence_in_numpy


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


def _limited(wanted, most):
    x, found = np.zeros(wanted.shape[1:]), []
    for w, m in zip(wanted, np.broadcast_to(most, wanted.shape), strict=True):
        x = x + np.clip(w - x, -m, m)
        found.append(x)
    return np.array(found)


def test_limited_steps_their_derivatives_and_batches(case):
    _, wanted, _ = case
    rng = np.random.default_rng(6)
    most, d_wanted, d_most = rng.uniform(0.2, 1.5, (50, 1)), rng.normal(size=(50, 3)), rng.normal(size=(50, 1))
    np.testing.assert_allclose(
        limited_in_numpy(wanted, np.broadcast_to(most, (50, 3))), _limited(wanted, most), rtol=1e-12
    )
    with jax.enable_x64(True):
        np.testing.assert_allclose(jax.jit(limited)(wanted, most), _limited(wanted, most), rtol=1e-12)
        both = jax.vmap(limited, (0, None))(np.stack([wanted, -wanted]), most)
        np.testing.assert_allclose(both[1], -_limited(wanted, most), rtol=1e-12)
        moved = jax.jvp(limited, (wanted, most), (d_wanted, d_most))[1]
        backwards = jax.grad(lambda h: jnp.sum(limited(wanted + h * d_wanted, most + h * d_most)))(0.0)
    step = 1e-7
    wanted_slope = (
        _limited(wanted + step * d_wanted, most + step * d_most)
        - _limited(wanted - step * d_wanted, most - step * d_most)
    ) / (2 * step)
    np.testing.assert_allclose(moved, wanted_slope, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(backwards, np.sum(wanted_slope), rtol=1e-5)
