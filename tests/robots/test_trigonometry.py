"""The rollouts' own sine and cosine against the C library's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.robots.trigonometry import sincos

pytestmark = pytest.mark.usefixtures("double_precision")


def test_error_stays_below_the_stated_bound():
    x = np.concatenate([np.linspace(-30, 30, 200_001), np.arange(-19, 20) * np.pi / 2, [0.0, 1e-300, -1e-12]])
    sine, cosine = jax.jit(sincos)(jnp.asarray(x))
    assert np.abs(sine - np.sin(x)).max() < 4e-16
    assert np.abs(cosine - np.cos(x)).max() < 4e-16


def test_large_angles_lose_no_more_than_the_rounding_of_the_argument():
    x = np.random.default_rng(1).uniform(-1e5, 1e5, 20_000)
    sine, cosine = sincos(jnp.asarray(x))
    allowed = 4e-16 + np.spacing(np.abs(x))
    assert np.all(np.abs(sine - np.sin(x)) < allowed) and np.all(np.abs(cosine - np.cos(x)) < allowed)


def test_derivatives_of_every_order_cycle():
    x = jnp.linspace(-4.0, 4.0, 41)

    def sine(t):
        return sincos(t)[0]

    first, second = jax.vmap(jax.grad(sine))(x), jax.vmap(jax.jacfwd(jax.jacfwd(sine)))(x)
    np.testing.assert_allclose(first, np.cos(x), atol=1e-15)
    np.testing.assert_allclose(second, -np.sin(x), atol=1e-15)


def test_a_number_that_is_not_finite_stays_visible():
    assert np.isnan(sincos(jnp.array([jnp.nan, jnp.inf]))).all()
