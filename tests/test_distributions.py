"""The tails against `scipy.stats`."""

import subprocess
import sys

import numpy as np
import pytest
import scipy.stats

from jaxid import _distributions as ours

X, P = np.array([-1.0, 0.0, 1e-3, 0.7, 3.0, 45.0, 700.0]), np.array([1e-12, 1e-3, 0.3, 0.975])


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (ours.chi_squared_tail(X, 3.5), scipy.stats.chi2.sf(X, 3.5)),
        (ours.chi_squared_beyond(P, 7), scipy.stats.chi2.isf(P, 7)),
        (ours.f_tail(X, 2, 40.0), scipy.stats.f.sf(X, 2, 40.0)),
        (ours.student_tail(X, 2.5), scipy.stats.t.sf(X, 2.5)),
        (ours.student_quantile(P, 4.0), scipy.stats.t.ppf(P, 4.0)),
        (ours.beta_tail([-0.1, 0.0, 0.2, 1.0], 0.4, 30.0), scipy.stats.beta.sf([0.0, 0.0, 0.2, 1.0], 0.4, 30.0)),
        (ours.normal_tail(X), scipy.stats.norm.sf(X)),
        (ours.normal_beyond(P), scipy.stats.norm.isf(P)),
        (ours.normal_density(X, 0.3, 1.7), scipy.stats.norm.pdf(X, 0.3, 1.7)),
    ],
)  # fmt: skip
def test_tails_are_scipys(found, expected):
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-300)


@pytest.mark.parametrize("samples", [20, 21, 400, 30_000])
def test_the_test_of_normality_is_scipys(samples):
    values = np.random.default_rng(samples).standard_t(7, samples) + 3.0
    np.testing.assert_allclose(ours.normal_test(values), scipy.stats.normaltest(values), rtol=1e-8)
    np.testing.assert_allclose(
        ours.moments(values), (scipy.stats.skew(values), scipy.stats.kurtosis(values)), rtol=1e-10
    )


def test_a_fit_imports_neither():
    """What they import takes longer than jaxid itself."""
    script = """
import sys, numpy as np, jaxid
u = np.repeat(np.random.default_rng(0).uniform(-2, 2, 12), 20)[:, None]
y = 0.01 * np.random.default_rng(1).normal(size=(240, 1))
v = 0.0
for k in range(240):
    y[k] += v
    v += 0.02 * (u[k, 0] - 2.0 * v)
log = jaxid.Log.from_arrays("a", 0.02 * np.arange(240), u, y, "axis")
jaxid.output_error(jaxid.Axis(), [log], start=dict(M=1.0, Fv=1.9, Fc=0.01, offset=0.0))
print([name for name in ("scipy.stats", "scipy.signal", "matplotlib") if name in sys.modules])
"""
    said = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True).stdout
    assert said.splitlines()[-1] == "[]"
