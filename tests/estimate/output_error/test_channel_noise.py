"""The noise of a channel from its residual: without bias, however many parameters were fitted to few samples."""

import jax.numpy as jnp
import numpy as np

from jaxid.estimate.output_error.bounds import Bounds
from jaxid.estimate.output_error.from_optimum import channel_noise
from jaxid.estimate.output_error.problem import Problem


def measured(E: int, T: int, ny: int, n: int) -> Problem:
    """E logs of T samples of ny channels, all measured, with n free parameters; no more of it is true."""
    one = jnp.ones(n)
    return Problem(
        dt=jnp.ones((E, T)), inputs=jnp.zeros((E, T, 1)), outputs=jnp.zeros((E, T, ny)), mask=jnp.ones((E, T, ny), bool),
        sigma=jnp.ones(ny), numbers={}, bounds=Bounds(-jnp.inf * one, jnp.inf * one, one), free=jnp.ones(n, bool),
        held=one, prior_mean=one, prior_precision=0.0 * one, start={}, state_free=jnp.zeros((E, 0), bool),
        state_scale=jnp.ones(0), state_precision=jnp.ones(0),
    )  # fmt: skip


def test_residual_of_a_polynomial_through_few_points_gives_the_noise_without_bias():
    """Mean over 4,000 fits of five unknowns (a polynomial) to twelve samples of noise 0.3."""
    rng = np.random.default_rng(4)
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1, 1, 12), 5))
    y = 0.3 * rng.normal(size=(4000, 12))
    squares = np.mean(np.sum((y - y @ basis @ basis.T) ** 2, axis=1))
    np.testing.assert_allclose(channel_noise(measured(1, 12, 1, 5), np.array([[squares]])), [0.3], rtol=0.01)
