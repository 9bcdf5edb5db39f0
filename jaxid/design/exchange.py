"""Random changes of an input by which an experiment is improved: stretches of time and lines of the spectrum exchanged.

Every change keeps the inputs within their limits. Directions are those in which the robot's inputs can be driven together
or one by one, [m, nu].
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Generator = np.random.Generator

_LEVELS = (-1.0, -0.5, 0.0, 0.5, 1.0)
_SHORTEST = 0.25
"""Of the robot's rise time: shorter pulses hardly move it."""


def _stretch(random: Generator, samples: int, rise: int) -> slice:
    """A random stretch of time, from a part of the rise time to a third of the record, short ones as likely as long ones."""
    shortest, longest = max(1, round(_SHORTEST * rise)), max(2, samples // 3)
    length = int(np.exp(random.uniform(np.log(shortest), np.log(max(longest, shortest + 1)))))
    first = int(random.integers(-length // 2, samples - length // 2))
    return slice(max(first, 0), min(first + length, samples))


def _direction(random: Generator, directions: Array) -> Array:
    return directions[random.integers(len(directions))]


def _level(u: Array, limit: Array, directions: Array, rise: int, random: Generator) -> Array:
    """A stretch at a constant level along one direction, what the inputs do across it unchanged."""
    where, direction = _stretch(random, len(u), rise), _direction(random, directions)
    size = random.choice(_LEVELS) if random.random() < 0.5 else random.uniform(-1, 1)
    unit = direction / np.linalg.norm(direction)
    full = np.min(limit[direction != 0] / np.abs(direction[direction != 0]))
    v = u.copy()
    v[where] += size * full * direction - (v[where] @ unit)[:, None] * unit
    return v


def _added(u: Array, limit: Array, directions: Array, rise: int, random: Generator) -> Array:
    """A stretch raised or lowered along one direction."""
    v, where = u.copy(), _stretch(random, len(u), rise)
    v[where] += random.normal(0.0, 0.4) * limit * _direction(random, directions)
    return v


def _turned(u: Array, limit: Array, directions: Array, rise: int, random: Generator) -> Array:
    """A stretch with its sign turned, of one input or all."""
    v, where = u.copy(), _stretch(random, len(u), rise)
    inputs = slice(None) if random.random() < 0.5 else random.integers(u.shape[1])
    v[where, inputs] *= -1
    return v


def _scaled(u: Array, limit: Array, directions: Array, rise: int, random: Generator) -> Array:
    """A stretch made larger or smaller."""
    v, where = u.copy(), _stretch(random, len(u), rise)
    v[where] *= np.exp(random.normal(0.0, 0.5))
    return v


def _moved(u: Array, limit: Array, directions: Array, rise: int, random: Generator) -> Array:
    """A stretch shifted in time by up to a rise time: switching earlier or later."""
    v, where = u.copy(), _stretch(random, len(u), rise)
    reach = max(1, rise // 2)
    v[where] = np.roll(v, int(random.integers(-reach, reach + 1)), axis=0)[where]
    return v


def _lines(u: Array, limit: Array, directions: Array, rise: int, random: Generator) -> Array:
    """Some lines of the spectrum up to one cycle a rise time with other amplitudes and phases, along one direction."""
    highest = max(2, min(len(u) // rise, len(u) // 2))
    spectrum = np.zeros(len(u) // 2 + 1, dtype=complex)
    for _ in range(random.integers(1, 4)):
        line = round(np.exp(random.uniform(0.0, np.log(highest))))
        spectrum[line] = 0.5 * len(u) * random.normal(0.0, 0.25) * np.exp(2j * np.pi * random.random())
    return u + np.fft.irfft(spectrum, len(u))[:, None] * limit * _direction(random, directions)


def _repeated(u: Array, limit: Array, directions: Array, rise: int, random: Generator) -> Array:
    """What is driven in one stretch also in another."""
    v, where = u.copy(), _stretch(random, len(u), rise)
    v[where] = np.roll(u, int(random.integers(1, len(u))), axis=0)[where]
    return v


Move = Callable[[Array, Array, Array, int, Generator], Array]
_MOVES: tuple[Move, ...] = (_level, _added, _turned, _scaled, _moved, _lines, _repeated)


def changed(u: Array, other: Array, limit: Array, directions: Array, rise: int, random: Generator) -> Array:
    """`u` [T, nu] after one to three random changes, or with a stretch of `other`; never beyond `limit` [nu].

    `rise` is the robot's rise time in samples.
    """
    if random.random() < 0.15:
        where = _stretch(random, len(u), rise)
        u = u.copy()
        u[where] = other[where]
    for _ in range(random.integers(1, 4)):
        move = _MOVES[random.integers(len(_MOVES))]
        u = np.clip(move(u, limit, directions, rise, random), -limit, limit)
    return u
