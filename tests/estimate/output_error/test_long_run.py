"""jaxid/estimate/output_error/long_run.py: batch means against the variance of white noise and of an AR(1)."""

import numpy as np
import pytest

from jaxid.estimate.output_error.long_run import long_run


def test_the_long_run_variance_is_one_for_white_noise_and_that_of_coloured_noise():
    random = np.random.default_rng(5)
    white = random.normal(size=(6, 2000, 2))
    white[:, ::7] = white[:, 1900:] = 0.0  # not measured
    assert long_run(white) == 1.0
    coloured = np.zeros((6, 2000, 1))
    for k in range(1, 2000):
        coloured[:, k] = 0.9 * coloured[:, k - 1] + np.sqrt(1.0 - 0.81) * random.normal(size=(6, 1))
    assert long_run(coloured) == pytest.approx(1.9 / 0.1, rel=0.4)  # of an AR(1): (1 + a) / (1 - a)
    assert long_run([np.zeros((5, 1))]) == 1.0 and long_run([np.ones((3, 1))]) == 1.0
