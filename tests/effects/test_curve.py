"""jaxid/effects/curve.py: the curve through heights, against SciPy's cubic Hermite spline with the slopes of parabolas."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from jaxid.effects.curve import curve


def splined(x, knots, heights, reach, derivative=0):
    """By SciPy; the slope at a knot is that of the parabola through it and its two neighbours."""
    knots, heights = np.asarray(knots), np.asarray(heights)
    slopes = [
        np.polyval(np.polyder(np.polyfit(knots[a : a + 3], heights[a : a + 3], 2)), knots[k])
        for k, a in enumerate(np.clip(np.arange(len(knots)) - 1, 0, len(knots) - 3))
    ]
    return CubicHermiteSpline(knots, heights, slopes)(np.clip(x / reach, knots[0], knots[-1]), derivative)


@pytest.mark.parametrize("knots", [(0.0, 0.2, 1.0), (0.0, 0.1, 0.4, 0.7, 1.0), (0.2, *np.linspace(0.3, 1.0, 16))])
def test_it_is_the_spline_and_its_derivative_with_numbers_and_where_jax_traces(knots):
    rng = np.random.default_rng(len(knots))
    heights, x = rng.normal(size=len(knots)), np.linspace(0.0, 2.0, 301)
    heights[rng.integers(len(knots))] = 0.0  # held at nothing
    expected = splined(x, knots, heights, 1.6)
    np.testing.assert_allclose(curve(x, knots, heights.tolist(), 1.6), expected, atol=1e-9)
    assert isinstance(curve(x, knots, heights.tolist(), 1.6), np.ndarray)
    with jax.enable_x64(True):
        traced = jax.jit(lambda x, h, r: curve(x, knots, list(h), r))
        np.testing.assert_allclose(traced(x, heights, 1.6), expected, atol=1e-9)
        slope = jax.jvp(lambda x: traced(x, heights, 1.6), (jnp.asarray(x),), (jnp.ones(301),))[1]
        inside = (x / 1.6 > knots[0]) & (x / 1.6 < knots[-1])
        np.testing.assert_allclose(slope[inside], splined(x, knots, heights, 1.6, 1)[inside] / 1.6, atol=1e-7)
        # Linear in the heights: another by its own curve.
        by_third = jax.grad(lambda h: curve(0.7, knots, list(h), 1.6))(jnp.asarray(heights))
        unit = [splined(0.7, knots, np.eye(len(knots))[k], 1.6) for k in range(len(knots))]
        np.testing.assert_allclose(by_third, unit, atol=1e-9)


def test_between_two_knots_it_is_a_line_and_of_nothing_it_is_nothing():
    np.testing.assert_allclose(curve(np.array([0.0, 0.5, 3.0]), (0.0, 1.0), [1.0, 2.0], 2.0), [1.0, 1.25, 2.0])
    assert np.all(curve(np.ones(3), (0.0, 0.5, 1.0), [0.0, 0.0, 0.0], 1.0) == 0.0)
