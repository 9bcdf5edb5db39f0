"""Integrals over windows, by which the checks see what an input does: held inputs and uneven times, summed by hand."""

import numpy as np

from jaxid import AXIS, Log
from jaxid.checks.windows import integral


def test_a_held_input_acts_from_its_sample_to_the_next():
    time = np.array([0.0, 0.1, 0.3, 0.35, 0.55, 0.6])
    log = Log.from_arrays("uneven", time, np.zeros(6), np.zeros((6, 2)), AXIS)
    rates = np.array([2.0, -1.0, 4.0, 0.5, 3.0, 1e9])  # the last acts after the log
    starts, stops = np.array([0, 1, 3]), np.array([2, 4, 5])
    by_hand = [2.0 * 0.1 - 1.0 * 0.2, -1.0 * 0.2 + 4.0 * 0.05 + 0.5 * 0.2, 0.5 * 0.2 + 3.0 * 0.05]
    np.testing.assert_allclose(integral(log, rates, starts, stops), by_hand, atol=1e-12)
    both = integral(log, np.stack([rates, 2 * rates], axis=1), starts, stops)
    np.testing.assert_allclose(both, np.outer(by_hand, [1, 2]), atol=1e-12)
