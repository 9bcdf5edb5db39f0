"""Projection onto bounds, and smooth coordinates without them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.estimate.output_error.bounds import Bounds, Unconstrained

pytestmark = pytest.mark.usefixtures("double_precision")

INF = jnp.inf


def bounds():
    """Free, bounded below (of small scale), bounded above, and twice bounded."""
    return Bounds(
        lower=jnp.array([-INF, 0.0, -INF, -0.2, 2.0]),
        upper=jnp.array([INF, INF, 5.0, 0.7, 2.5]),
        scale=jnp.array([3.0, 1e-4, 2.0, 0.5, 1.0]),
    )


INSIDE = jnp.array([-7.0, 3e-4, 1.0, 0.3, 2.2])


def test_coordinates_and_parameters_are_inverse_inside_the_bounds():
    b = bounds()
    np.testing.assert_allclose(b.physical(b.coordinates(INSIDE)), INSIDE, rtol=1e-14)


def test_beyond_a_bound_lies_the_bound():
    b = bounds()
    far = b.physical(jnp.full(5, -1e6)), b.physical(jnp.full(5, 1e6))
    np.testing.assert_array_equal(far[0][jnp.array([1, 3, 4])], [0.0, -0.2, 2.0])
    np.testing.assert_array_equal(far[1][jnp.array([2, 3, 4])], [5.0, 0.7, 2.5])
    np.testing.assert_array_equal(b.physical(b.coordinates(jnp.array([0.0, -1.0, 9.0, 3.0, -1.0]))), far_mix())


def far_mix():
    return [0.0, 0.0, 5.0, 0.7, 2.0]


def smooth():
    b = bounds()
    z = b.coordinates(INSIDE)
    return Unconstrained.around(b, z, jnp.full(5, 0.1)), z


def test_unconstrained_coordinates_are_inverse_and_their_slope_is_the_derivative():
    chart, z = smooth()
    q = chart.from_z(z)
    np.testing.assert_allclose(chart.to_z(q), z, rtol=1e-10)
    for shift in (-3.0, 0.0, 2.0):
        at = q + shift
        np.testing.assert_allclose(chart.slope(at), jnp.diagonal(jax.jacfwd(chart.to_z)(at)), rtol=1e-9)


def test_unconstrained_coordinates_never_leave_the_bounds_and_reach_them():
    chart, _ = smooth()
    b = bounds()
    for q in (-1e6, -1.0, 0.0, 1.0, 1e6):
        theta = chart.to_z(jnp.full(5, q)) * b.scale
        assert bool(jnp.all((theta >= b.lower) & (theta <= b.upper)))
    near = chart.to_z(jnp.full(5, -1e4)) * b.scale
    assert float(near[1]) < 1e-7 * 3e-4 and float(near[3] + 0.2) < 1e-7


def test_a_start_on_a_bound_is_moved_just_inside():
    b = bounds()
    z = b.coordinates(jnp.array([0.0, 0.0, 5.0, -0.2, 2.5]))
    chart = Unconstrained.around(b, z, jnp.full(5, 0.1))
    q = chart.from_z(z)
    assert bool(jnp.all(jnp.isfinite(q))) and bool(jnp.all(jnp.abs(chart.slope(q)) > 1e-3))
    inside = chart.to_z(q) * b.scale
    assert bool(jnp.all((inside > b.lower) & (inside < b.upper)))
