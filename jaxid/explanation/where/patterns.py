"""What the missing force is a function of: heading, direction of travel, speed, yaw rate, place, time or input, or two of them.

Conditions tell when a force is large; a force such as a slope's is as large under all of them and only changes its
sign. Each pattern is a few functions of a log's `Motion`; the share of the missing force that their linear combination
reproduces, less what it reproduces of forces moved to random moments of the same runs, says how well it fits.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .conditions import Motion
from .missing_force import ForceHistory

_SHIFTS = 400
_SEED = 21
LEAST_SHARE = 0.5
"""Share of the missing force that a pattern must reproduce to be named."""
FALSE_ALARM = 0.01
_KNOTS = (0.0, 0.1, 0.3, 0.6, 1.0)
"""Shares of the largest speed or input between which a curve of it is straight."""
_PAIRED = 4
"""Patterns of which all pairs are tried."""
_FOR_TWO = 0.15
"""Share of the force by which a pair must reproduce more than one pattern."""


@dataclass(frozen=True)
class Pattern:
    """`share` of the missing force's mean square that `name` reproduces, chance taken off; `p_value` of that chance.

    `pair`: whether two patterns make it together. `fitted` holds what it reproduces of every log's force [T, n], in the
    force's units.
    """

    name: str
    phrase: str
    share: float
    p_value: float
    fitted: tuple[NDArray[np.float64], ...] = field(repr=False, default=())
    pair: bool = False

    @property
    def stands_out(self) -> bool:
        """Whether the pattern reproduces at least half of the force, and more than chance does."""
        return self.share >= LEAST_SHARE and self.p_value < FALSE_ALARM


def answering(found: Sequence[Pattern]) -> Pattern | None:
    """What the missing force follows: a pair that stands out, since it reproduces far more than either does alone, else the
    best pattern that does."""
    out = [pattern for pattern in found if pattern.stands_out]
    return next((pattern for pattern in out if pattern.pair), out[0] if out else None)


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
    return np.column_stack([share**0, share, share**2])


def _input(motion: Motion) -> NDArray:
    return _curves(motion.inputs / motion.largest, odd=True)


_FAMILIES: tuple[tuple[str, str, Callable[[Motion], NDArray | None]], ...] = (
    ("heading", "follows the heading, as a constant force in the world does", _heading),
    ("direction of travel", "has the sign of the direction of travel", _direction),
    ("speed", "follows the speed", _speed),
    ("yaw rate", "follows the yaw rate", _turning),
    ("place", "follows the place on the floor", _place),
    ("time", "changes steadily over the run", _time),
    ("input", "follows the input", _input),
)


def _moved_squares(basis: list[NDArray], values: list[NDArray], rng: np.random.Generator) -> NDArray:
    """Sum of squares that an orthonormal basis reproduces of forces shifted by random times in every log [_SHIFTS]."""
    products = np.zeros((_SHIFTS, basis[0].shape[1], values[0].shape[1]))
    for b, v in zip(basis, values, strict=True):
        spectrum = np.fft.rfft(b, axis=0)[:, :, None] * np.conj(np.fft.rfft(v, axis=0))[:, None, :]
        products += np.fft.irfft(spectrum, len(v), axis=0)[rng.integers(0, len(v), _SHIFTS)]
    return np.sum(products**2, axis=(1, 2))


def patterns(forces: Sequence[ForceHistory], seen: Sequence[Motion]) -> tuple[Pattern, ...]:
    """How much of the missing force each pattern reproduces, best first, and after them the pair of patterns that reproduces
    most together, where that is more by `_FOR_TWO` than the best alone. `seen[e]` belongs to `forces[e]`."""
    values = [force.force / force.scale for force in forces]
    if not sum(np.sum(v**2) for v in values) > 0:
        return ()
    families = [(name, phrase, [family(motion) for motion in seen]) for name, phrase, family in _FAMILIES]
    known = [(n, p, [c for c in columns if c is not None]) for n, p, columns in families]
    known = [(name, phrase, columns) for name, phrase, columns in known if len(columns) == len(seen)]
    scale = forces[0].scale
    found = sorted((_pattern(n, p, columns, values, scale) for n, p, columns in known), key=lambda own: -own.share)
    by_name = {name: (phrase, columns) for name, phrase, columns in known}
    together = []
    for first, second in itertools.combinations([own.name for own in found[:_PAIRED]], 2):
        both = [np.column_stack(each) for each in zip(by_name[first][1], by_name[second][1], strict=True)]
        phrase = f"{by_name[first][0]}, and {by_name[second][0]}"
        together.append(_pattern(f"{first} and {second}", phrase, both, values, scale))
    best = max(together, key=lambda pair: pair.share, default=None)
    if best is not None and best.share > found[0].share + _FOR_TWO:
        found.append(replace(best, pair=True))
    return tuple(found)


def _pattern(
    name: str, phrase: str, columns: Sequence[NDArray], values: list[NDArray], scale: NDArray[np.float64]
) -> Pattern:
    """What the sums of a pattern's `columns` [T, k] of every log reproduce of the forces `values` [T, n]."""
    rng = np.random.default_rng(_SEED)
    edges = np.cumsum([len(v) for v in values])[:-1]
    whole = float(sum(np.sum(v**2) for v in values))
    basis, scales, _ = np.linalg.svd(np.concatenate(columns), full_matrices=False)
    basis = basis[:, scales > 1e-9 * max(scales[0], 1e-300)]
    at_places = np.split(basis, edges)
    products = sum(b.T @ v for b, v in zip(at_places, values, strict=True))
    squares = np.concatenate([[np.sum(products**2)], _moved_squares(at_places, values, rng)]) / whole
    chance = float(np.mean(squares[1:]))
    p_value = (1.0 + np.count_nonzero(squares[1:] >= squares[0])) / (1.0 + _SHIFTS)
    share = float((squares[0] - chance) / max(1 - chance, 1e-9))
    fitted = basis @ products * scale
    return Pattern(name, phrase, share, float(p_value), tuple(np.split(fitted, edges)))
