"""The filters against `scipy.signal`."""

import numpy as np
import pytest
import scipy.signal

from jaxid import _filters as ours


@pytest.mark.parametrize("decay", [0.0, 0.6, 0.9999])
def test_filters_are_scipys(decay):
    values = np.random.default_rng(1).normal(size=(500, 3))
    np.testing.assert_allclose(
        ours.lagged(values, decay),
        scipy.signal.lfilter([1 - decay], [1, -decay], values, axis=0),
        rtol=1e-12,
        atol=1e-12,
    )
    taps = np.array([1.0, -decay, 0.3])
    np.testing.assert_allclose(
        ours.filtered(taps, values[:, 0]), scipy.signal.lfilter(taps, 1.0, values[:, 0]), rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("taps", [[1.0], [1.0, -0.9], [1.0, -1.6, 0.8], [1.0, 0.2, -0.3, 0.5, 0.1]])
def test_an_autoregression_is_scipys(taps):
    values = np.random.default_rng(2).normal(size=(2_000, 2))
    expected = scipy.signal.lfilter([1.0], taps, values, axis=0)
    np.testing.assert_allclose(ours.autoregressive(np.array(taps), values), expected, rtol=1e-9, atol=1e-11)
