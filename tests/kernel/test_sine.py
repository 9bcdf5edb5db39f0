"""Sine and cosine in vector instructions against NumPy's, which are the C library's."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import float64
from jaxid.kernel.call import System
from jaxid.kernel.direct import outputs
from jaxid.kernel.machine import lanes

CIRCLE = System(lambda p, x, u, h: (x[0],), lambda p, x, u: (jnp.sin(u[0]), jnp.cos(u[0])), (0, 1, 1), 2)


def both(angles):
    """Sines and cosines of angles [T, L]."""
    (T, L), dt = angles.shape, np.ones((1, len(angles), angles.shape[1]))
    with float64():
        seen = np.ones((1, L)), np.zeros((1, 0, L)), np.zeros((1, 1, L)), angles.reshape(1, T, 1, 1, L), dt
        return np.moveaxis(outputs(CIRCLE, (*seen, np.zeros((1, T, 0, L))))[0], 1, 0)


@pytest.mark.parametrize("largest", [0.1, 1.0, 10.0, 1e3, 1e6, 9e8])
def test_the_last_digit_is_right_or_next_to_it(largest):
    rng = np.random.default_rng(0)
    angles = largest * rng.uniform(-1.0, 1.0, (2_000, lanes()))
    angles[:40, 0] = np.arange(40) * (np.pi / 2)  # next to zeros and ends
    angles[:40, 1] = np.arange(40) * (np.pi / 4)
    for found, true in zip(both(angles), (np.sin(angles), np.cos(angles)), strict=True):
        assert np.all(np.abs(found - true) <= 1.0 * np.spacing(np.abs(true)))


def test_what_is_large_or_no_number_is_the_librarys():
    angles = np.full((6, lanes()), 0.5)
    angles[:, 0] = [1e12, -1e300, np.inf, np.nan, -0.0, 1e-300]
    with np.errstate(invalid="ignore"):
        true = np.sin(angles), np.cos(angles)
    for found, expected in zip(both(angles), true, strict=True):
        np.testing.assert_array_equal(found, expected)
