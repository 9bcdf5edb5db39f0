"""Linear recurrences, held to a loop in Python, under every transformation of JAX's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.kernel.recurrence import recurrence, recurrence_in_numpy


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
