"""Bounds by transformation: inverse, slope, never left, reached."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.estimate.output_error.bounds import Bounds

pytestmark = pytest.mark.usefixtures("double_precision")
INF = np.inf


def bounds():
    """Free, bounded below, above, on both sides; of different magnitudes."""
    return Bounds(
        lower=jnp.array([-INF, 0.0, -INF, -0.2, 2.0]),
        upper=jnp.array([INF, INF, 5.0, 0.7, 2.5]),
        scale=jnp.array([3.0, 1e-4, 2.0, 1.0, 0.1]),
    )


def points(n=200):
    rng = np.random.default_rng(1)
    return jnp.asarray(np.concatenate([rng.normal(size=(n, 5)), 30 * rng.normal(size=(n, 5))]))


def test_coordinates_are_the_inverse_away_from_the_bounds():
    b = bounds()
    theta = jnp.array([-7.0, 3e-4, 1.0, 0.6, 2.01])
    np.testing.assert_allclose(b.physical(b.coordinates(theta)), theta, rtol=1e-12)
    z = jnp.asarray(np.random.default_rng(2).uniform(0.0, 2.0, (100, 5)))
    np.testing.assert_allclose(jax.vmap(lambda x: b.coordinates(b.physical(x)))(z), z, rtol=1e-9, atol=1e-12)


def test_slope_is_the_derivative():
    b, z, step = bounds(), points(), 1e-6
    physical, slopes = jax.jit(jax.vmap(b.physical)), jax.jit(jax.vmap(b.slope))
    numeric = (physical(z + step) - physical(z - step)) / (2 * step)
    slope = slopes(z)
    np.testing.assert_allclose(slope / b.scale, numeric / b.scale, atol=1e-7)


def test_bounds_are_never_left_and_the_slope_never_turns():
    b = bounds()
    z = jnp.concatenate([points(), jnp.full((1, 5), 1e12), jnp.full((1, 5), -1e12)])
    theta = jax.vmap(b.physical)(z)
    assert bool(jnp.all(theta >= b.lower)) and bool(jnp.all(theta <= b.upper))
    signs = jnp.sign(jax.vmap(b.slope)(z))
    assert bool(jnp.all(signs * jnp.array([1, 1, -1, 1, 1]) >= 0))


def test_a_bound_is_reached_algebraically():
    """With a distance that falls as 1 / |z|, not exp(-|z|): ten times the way, a tenth of the distance."""
    b = bounds()
    near, nearer = (b.physical(jnp.full(5, -z)) for z in (10.0, 100.0))
    assert float(nearer[1] / near[1]) == pytest.approx(0.1, rel=1e-3)
    assert float(near[1]) < 1e-5 * 1e-4 * 1.01
    above = [5.0 - float(b.physical(jnp.full(5, z))[2]) for z in (-10.0, -100.0, 100.0)]
    assert above[1] == pytest.approx(0.1 * above[0], rel=1e-3)
    assert above[2] == pytest.approx(200.0)  # bounded above: far below is free


def test_a_start_on_a_bound_is_moved_just_inside():
    b = bounds()
    theta = jnp.array([0.0, 0.0, 5.0, -0.2, 2.5])
    z = b.coordinates(theta)
    assert bool(jnp.all(jnp.isfinite(z)))
    inside = b.physical(z)
    assert bool(jnp.all((inside > b.lower) & (inside < b.upper)))
    half = jnp.array([1.0, 1e-4, 2.0, 0.45, 0.25])
    assert bool(jnp.all(jnp.abs(inside - theta) <= 0.021 * half))
    assert bool(jnp.all(jnp.abs(b.slope(z)) > 0.001 * b.scale))


def test_far_from_its_bound_a_parameter_moves_as_if_there_were_none():
    b = bounds()
    assert float(b.slope(jnp.full(5, 5.0))[1]) == pytest.approx(1e-4, rel=1e-5)


def test_what_is_reachable_keeps_a_slope_and_leaves_sound_coordinates_alone():
    b = bounds()
    sound = b.coordinates(jnp.array([-7.0, 3e-4, 1.0, 0.3, 2.2]))
    np.testing.assert_array_equal(b.reachable(sound), sound)
    for z in (-1e6, 1e6):
        far = b.reachable(jnp.full(b.lower.shape, z))
        free_side = jnp.isfinite(far) & (jnp.abs(b.slope(far)) > 1e-4 * b.scale)
        assert bool(jnp.all(free_side))
