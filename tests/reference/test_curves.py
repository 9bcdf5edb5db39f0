"""Drawn curves: the ends that they promise, and no turning back."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from reference import curves

Z = np.linspace(0.0, 1.0, 501)
SEEDS = range(5)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_curve_is_the_hermite_cubic_of_its_points(seed):
    for draw in (curves.growing, curves.convex, curves.falling, curves.compressing, curves.periodic):
        curve = draw(seed)
        expected = CubicHermiteSpline(curves.PLACES, curve[: curves.KNOTS], curve[curves.KNOTS :])(Z)
        np.testing.assert_allclose(curves.evaluate(curve, Z), expected, atol=1e-14)


@pytest.mark.parametrize("seed", SEEDS)
def test_curves_do_not_turn_back(seed):
    for draw, sign in ((curves.growing, 1), (curves.convex, 1), (curves.falling, -1), (curves.compressing, 1)):
        assert (sign * np.diff(curves.evaluate(draw(seed), Z)) >= -1e-12).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_ends(seed):
    ends = np.array([0.0, 1.0])
    np.testing.assert_allclose(curves.evaluate(curves.growing(seed), ends), [0, 1], atol=1e-12)
    np.testing.assert_allclose(curves.evaluate(curves.convex(seed), ends), [0, 1], atol=1e-12)
    np.testing.assert_allclose(curves.evaluate(curves.falling(seed), np.array([0.0, 1.0, 7.0])), [1, 0, 0], atol=1e-12)
    small = 1e-5
    assert curves.evaluate(curves.compressing(seed), np.array([small]))[0] == pytest.approx(small, rel=1e-3)
    far = curves.evaluate(curves.compressing(seed), np.array([1.0, 9.0]))
    assert far[0] == far[1] < 1.0


@pytest.mark.parametrize("seed", SEEDS)
def test_a_period_closes_smoothly(seed):
    curve = curves.periodic(seed)
    ends = curves.evaluate(curve, np.array([0.0, 1.0 - 1e-12]))
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)
    assert curve[curves.KNOTS] == pytest.approx(curve[-1])


def test_seeds_draw_different_curves_and_the_same_again():
    assert np.array_equal(curves.growing(3), curves.growing(3))
    assert not np.allclose(curves.growing(3), curves.growing(4))
