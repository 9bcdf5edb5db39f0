"""A noise level that is known only roughly, on the one model that has its whole distribution in closed form: groups of
measurements of one mean that scatter by their own known errors and by a common level besides (random effects)."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import fminbound

from jaxid.estimate.prediction_error.scoring import QUIETEST
from jaxid.estimate.prediction_error.unknown_levels import Looks, averaged

LEVELS, MOVED = range(1, 2), np.ones(2, dtype=bool)


def look(y, errors, mean, level):
    """-log L at a mean and a logarithm of the common scatter, its derivatives and the information."""
    common = np.exp(2 * level)
    S = errors**2 + common
    gradient = np.array([-np.sum((y - mean) / S), np.sum(common / S * (1 - (y - mean) ** 2 / S))])
    information = np.diag([np.sum(1 / S), 2 * np.sum((common / S) ** 2)])
    return 0.5 * np.sum((y - mean) ** 2 / S + np.log(S)), gradient, information


def likeliest(y, errors):
    """Mean and logarithm of the common scatter."""

    def weighted(level):
        return np.average(y, weights=1 / (errors**2 + np.exp(2 * level)))

    found = fminbound(lambda at: look(y, errors, weighted(at), at)[0], QUIETEST, 5.0)
    level = min((float(np.min(found)), QUIETEST), key=lambda at: look(y, errors, weighted(at), at)[0])
    return np.array([weighted(level), level])


def exact(y, errors, estimate):
    """Root mean square of the mean about its estimate, all values of mean and common variance considered: Jeffreys' prior
    of the variance, a flat one of the mean, integrals by quadrature."""

    def density(variance, power):
        S = errors**2 + variance
        mean, about = np.average(y, weights=1 / S), 1 / np.sum(1 / S)
        logarithm = -0.5 * np.sum((y - mean) ** 2 / S + np.log(S)) + 0.5 * np.log(about) + 0.5 * np.log(np.sum(S**-2.0))
        return np.exp(logarithm) * (about + (mean - estimate) ** 2) ** power

    edges = [0.0, 0.1, 1.0, 10.0, 100.0, 1e4]
    second, all_of_it = (
        sum(quad(density, low, high, args=(power,))[0] for low, high in zip(edges, edges[1:], strict=False))
        for power in (1, 0)
    )
    return np.sqrt(second / all_of_it)


def spread(y, errors):
    x = likeliest(y, errors)

    def looks(points):
        return Looks(*map(np.array, zip(*(look(y, errors, *point) for point in points), strict=True)))

    return x, np.sqrt(averaged(x, look(y, errors, *x)[2], looks, LEVELS, MOVED)[0, 0])


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("common", [0.0, 0.5, 2.0])
def test_the_standard_error_is_that_of_the_whole_distribution(common, seed):
    random = np.random.default_rng([seed, 31])
    errors = random.uniform(0.5, 2.0, 20)
    y = 3.0 + np.sqrt(errors**2 + common**2) * random.normal(size=20)
    x, error = spread(y, errors)
    assert error == pytest.approx(exact(y, errors, x[0]), rel=0.03)


def test_a_level_that_is_known_well_leaves_the_information_alone():
    random = np.random.default_rng(1)
    errors = np.full(400, 0.1)
    y = 3.0 + np.hypot(0.1, 1.0) * random.normal(size=400)
    x, error = spread(y, errors)
    assert error == pytest.approx(look(y, errors, *x)[2][0, 0] ** -0.5, rel=1e-12)
