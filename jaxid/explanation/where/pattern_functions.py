"""Functions of a robot's motion that a missing force may be a combination of: of one thing, or of two of which one changes
what the other makes."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from .conditions import Motion

Functions = Callable[[Motion], NDArray | None]
"""Some functions of a log's motion [T, k]; None where the robot has no such thing."""
_KNOTS = (0.0, 0.1, 0.3, 0.6, 1.0)
"""Shares of the largest speed or input between which a curve of it is straight."""


def _curves(x: NDArray, odd: bool, even: bool = False) -> NDArray:
    """Any smooth curve of each column of `x` [T, n], of size about 1: columns whose sums are straight between `_KNOTS`."""
    size = np.minimum(np.abs(x), _KNOTS[-1])
    hats = [np.interp(size, _KNOTS, row) for row in np.eye(len(_KNOTS))[1:]]
    halves = [hat * np.sign(x) for hat in hats if odd] + [hat for hat in hats if even]
    return np.concatenate(halves, axis=1)


def _heading(motion: Motion) -> NDArray | None:
    if motion.heading is None:
        return None
    return np.stack([np.cos(motion.heading), np.sin(motion.heading)], axis=1)


def _direction(motion: Motion) -> NDArray:
    return np.where(np.abs(motion.axes) > motion.still, np.sign(motion.axes), 0.0)


def _speed(motion: Motion) -> NDArray:
    return _curves(motion.axes / motion.fastest, odd=True, even=True)


def _turning(motion: Motion) -> NDArray | None:
    if motion.turning is None or not motion.turning_fastest > 0:
        return None
    return _curves(motion.turning[:, None] / motion.turning_fastest, odd=True, even=True)


def _place(motion: Motion) -> NDArray | None:
    if motion.path is None or motion.middle is None:
        return None
    off = motion.path - motion.middle
    return np.column_stack([off, off**2, np.prod(off, axis=1)]) if off.shape[1] > 1 else np.column_stack([off, off**2])


def _time(motion: Motion) -> NDArray:
    share = (motion.time - motion.time[0]) / max(motion.time[-1] - motion.time[0], 1e-300)
    return np.column_stack([share, share**2])


def _input(motion: Motion) -> NDArray:
    return _curves(motion.inputs / motion.largest, odd=True)


FAMILIES: tuple[tuple[str, str, Functions], ...] = (
    ("heading", "follows the heading, as a constant force in the world does", _heading),
    ("direction of travel", "has the sign of the direction of travel", _direction),
    ("speed", "follows the speed", _speed),
    ("yaw rate", "follows the yaw rate", _turning),
    ("place", "follows the place on the floor", _place),
    ("time", "changes steadily over the run", _time),
    ("input", "follows the input", _input),
)


def _product(by: Functions, of: Callable[[Motion], NDArray]) -> Functions:
    """Functions of one thing times each of another's."""

    def columns(motion: Motion) -> NDArray | None:
        changing, own = by(motion), of(motion)
        if changing is None:
            return None
        return np.concatenate([changing * own[:, [i]] for i in range(own.shape[1])], axis=1)

    return columns


def _speeds(motion: Motion) -> NDArray:
    return motion.axes / motion.fastest


def _inputs(motion: Motion) -> NDArray:
    return motion.inputs / motion.largest


def _along_the_world(motion: Motion) -> NDArray | None:
    """A force of the world that changes evenly with the place, as its parts along the robot show it."""
    heading, place = _heading(motion), _place(motion)
    if heading is None or place is None or place.shape[1] < 5:
        return None
    even = np.column_stack([np.ones(len(place)), place[:, :2]])
    return np.concatenate([even * heading[:, [i]] for i in range(2)], axis=1)


PRODUCTS: tuple[tuple[str, tuple[str, str], str, Functions], ...] = (
    (
        "heading by place",
        ("heading", "place"),
        "follows the heading and the place, as a force in the world does that is another one elsewhere",
        _along_the_world,
    ),
    (
        "direction of travel by place",
        ("direction of travel", "place"),
        "has the sign of the direction of travel and changes with the place, as dry friction of a floor does",
        _product(_place, _direction),
    ),
    (
        "speed by place",
        ("speed", "place"),
        "goes with the speed and changes with the place",
        _product(_place, _speeds),
    ),
    (
        "direction of travel by time",
        ("direction of travel", "time"),
        "has the sign of the direction of travel and changes over the run, as dry friction does that warms up",
        _product(_time, _direction),
    ),
    (
        "speed by time",
        ("speed", "time"),
        "goes with the speed and changes over the run, as viscous friction does that warms up",
        _product(_time, _speeds),
    ),
    (
        "input by time",
        ("input", "time"),
        "goes with the input and changes over the run, as of a battery that runs down",
        _product(_time, _inputs),
    ),
)
"""Names of two things one of which changes what the other makes, those two, their phrase, and the functions."""
BY_LOG: tuple[tuple[str, str, Callable[[Motion], NDArray]], ...] = (
    (
        "direction of travel by log",
        "has the sign of the direction of travel and is another in each log, as dry friction is on another day or floor",
        _direction,
    ),
    (
        "speed by log",
        "goes with the speed and is another in each log, as viscous friction is on another day",
        _speeds,
    ),
    (
        "input by log",
        "goes with the input and is another in each log, as with another battery or payload",
        _inputs,
    ),
)
"""The same of what differs between logs."""


def of_parameters(motion: Motion, but: Sequence[str]) -> NDArray:
    """What wrong parameters make of a motion, `but` some [T, k]."""
    every = {"speed": _speeds, "direction of travel": _direction, "input": _inputs}
    kept = [of(motion) for name, of in every.items() if name not in but]
    return np.concatenate(kept, axis=1) if kept else np.zeros((len(motion.time), 0))


def in_each(of: Callable[[Motion], NDArray], seen: Sequence[Motion]) -> list[NDArray]:
    """Functions of one thing, each log's own: zero in all other logs."""
    own = [of(motion) for motion in seen]
    k = own[0].shape[1]
    return [np.pad(values, ((0, 0), (e * k, (len(own) - 1 - e) * k))) for e, values in enumerate(own)]
