"""Curves that are no published law: monotone piecewise cubics through points drawn from a seed.

A curve is a vector (2 KNOTS,): its values at KNOTS equidistant places of [0, 1] and its slopes there (Hermite's form).
The slopes of `growing`, `falling`, `convex` and `periodic` are those of Fritsch and Carlson (1980), which keep monotone
points monotone; `compressing` draws the slopes themselves.
"""

import numpy as np
from numba import njit
from scipy.interpolate import PchipInterpolator

KNOTS = 6
PLACES = np.linspace(0.0, 1.0, KNOTS)


def _through(values: np.ndarray) -> np.ndarray:
    return np.concatenate((values, PchipInterpolator(PLACES, values).derivative()(PLACES)))


def _rng(seed: float) -> np.random.Generator:
    return np.random.default_rng([int(seed), 77])


def _increments(seed: float) -> np.ndarray:
    steps = _rng(seed).uniform(0.1, 1.0, KNOTS - 1)
    return steps / steps.sum()


def growing(seed: float) -> np.ndarray:
    """From 0 at 0 to 1 at 1, never falling."""
    return _through(np.append(0.0, np.cumsum(_increments(seed))))


def convex(seed: float) -> np.ndarray:
    """From 0 at 0 to 1 at 1, steeper and steeper; flat at 0."""
    steps = np.sort(_increments(seed)) ** 2
    curve = _through(np.append(0.0, np.cumsum(steps / steps.sum())))
    curve[KNOTS] = 0.0
    return curve


def falling(seed: float) -> np.ndarray:
    """From 1 at 0 to 0 at 1, never rising, and flat at 1: beyond it there is nothing."""
    curve = _through(np.append(1.0, 1.0 - np.cumsum(np.sort(_increments(seed))[::-1])))
    curve[KNOTS - 1] = curve[-1] = 0.0
    return curve


def compressing(seed: float) -> np.ndarray:
    """From 0 with slope 1 to slope 0 at 1: the identity for small arguments, a limit for large ones."""
    slopes = np.append(1.0, np.append(np.sort(_rng(seed).uniform(0.05, 0.95, KNOTS - 2))[::-1], 0.0))
    values = np.append(0.0, np.cumsum(0.5 * (slopes[1:] + slopes[:-1]) / (KNOTS - 1)))
    return np.concatenate((values, slopes))


def periodic(seed: float) -> np.ndarray:
    """One period, mean of the points 0, largest 1."""
    values = _rng(seed).uniform(-1.0, 1.0, KNOTS - 1)
    values -= values.mean()
    values = np.append(values, values[0]) / np.abs(values).max()
    around = PchipInterpolator(
        np.linspace(-1.0, 2.0, 3 * KNOTS - 2), np.concatenate((values[:-1], values[:-1], values))
    )
    return np.concatenate((values, around.derivative()(PLACES)))


@njit
def at(z, e, place):
    """The curve stored in e from `place` on, at z >= 0; beyond 1 straight on with its last slope."""
    last = KNOTS - 1
    if z >= 1.0:
        return e[place + last] + (z - 1.0) * e[place + KNOTS + last]
    k = int(z * last)
    h = 1.0 / last
    r = z * last - k
    return (
        e[place + k] * (1 + 2 * r) * (1 - r) ** 2
        + e[place + KNOTS + k] * h * r * (1 - r) ** 2
        + e[place + k + 1] * r * r * (3 - 2 * r)
        + e[place + KNOTS + k + 1] * h * r * r * (r - 1)
    )


def evaluate(curve: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The curve at an array of places z >= 0."""
    return np.array([at(float(each), curve, 0) for each in np.ravel(z)]).reshape(np.shape(z))
