"""The noise of a channel from its residual: without bias, however many parameters were fitted to few samples."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from jaxid.estimate.output_error.from_optimum import channel_noise


def test_residual_of_a_polynomial_through_few_points_gives_the_noise_without_bias():
    """Mean over 4,000 fits of five unknowns (a polynomial) to twelve samples of noise 0.3."""
    rng = np.random.default_rng(4)
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1, 1, 12), 5))
    y = 0.3 * rng.normal(size=(4000, 12))
    squares = np.mean(np.sum((y - y @ basis @ basis.T) ** 2, axis=1))
    unknowns = {"free": np.ones(5, bool), "state_free": np.zeros((1, 0), bool)}
    problem: Any = SimpleNamespace(mask=np.ones((1, 12, 1), bool), sigma=np.array([1.0]), **unknowns)
    np.testing.assert_allclose(channel_noise(problem, np.array([[squares]])), [0.3], rtol=0.01)
