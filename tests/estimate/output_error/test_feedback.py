"""estimate/output_error/feedback.py: what follows a residual, and what a residual foretells that knows of a command early."""

import numpy as np
import pytest
from scipy.signal import lfilter

from jaxid.estimate.output_error.feedback import feedback


def moved(u):
    """A first-order axis with noise, and what its model leaves where its sensor is a row early."""
    v = lfilter([0.1], [1.0, -0.9], u)
    return v, np.concatenate([v[1:], v[-1:]]) - v


@pytest.mark.parametrize("levels", [(-0.3, 0.3), (-1.0, 0.0, 0.5)])
def test_levels_whose_changes_are_seen_early_are_no_controllers(levels):
    rng = np.random.default_rng(3)
    u = np.repeat(rng.choice(levels, 200), 20)
    _, left = moved(u)
    found = feedback([u], [(left + 0.01 * rng.normal(size=len(u)))[:, None]])
    assert not found.closed and found.share == 0.0


def test_a_controller_is_seen():
    rng = np.random.default_rng(4)
    noise, wanted = 0.05 * rng.normal(size=4000), np.repeat(rng.choice([-0.5, 0.5], 80), 50)
    v, u = np.zeros(4000), np.zeros(4000)
    for k in range(3999):
        u[k] = 3.0 * (wanted[k] - v[k] - noise[k])
        v[k + 1] = 0.9 * v[k] + 0.1 * u[k]
    assert feedback([u], [noise[:, None]]).closed
