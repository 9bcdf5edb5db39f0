"""What the missing force varies with: heading, direction of travel, speed, place, time or input.

Conditions tell when a force is large; a force such as a slope's is as large under all of them and only changes its
sign. Each pattern is a few functions of a log's `Motion`; the share of the missing force that their linear combination
reproduces, less what it reproduces of forces moved to random moments of the same runs, says how well it fits.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .conditions import Motion
from .missing_force import ForceHistory

_SHIFTS = 400
_SEED = 21
LEAST_SHARE = 0.5
"""Share of the missing force that a pattern must reproduce to be named."""
FALSE_ALARM = 0.01


@dataclass(frozen=True)
class Pattern:
    """`share` of the missing force's mean square that `name` reproduces, chance taken off; `p_value` of that chance.

    `fitted` holds what it reproduces of every log's force [T, n], in the force's units.
    """

    name: str
    phrase: str
    share: float
    p_value: float
    fitted: tuple[NDArray[np.float64], ...] = field(repr=False, default=())

    @property
    def stands_out(self) -> bool:
        """Whether the pattern reproduces at least half of the force, and more than chance does."""
        return self.share >= LEAST_SHARE and self.p_value < FALSE_ALARM


def _heading(motion: Motion) -> NDArray | None:
    if motion.heading is None:
        return None
    return np.stack([np.cos(motion.heading), np.sin(motion.heading)], axis=1)


def _direction(motion: Motion) -> NDArray:
    return np.where(np.abs(motion.axes) > motion.still, np.sign(motion.axes), 0.0)


def _speed(motion: Motion) -> NDArray:
    axes = motion.axes / motion.fastest
    return np.concatenate([axes, axes * np.abs(axes)], axis=1)


def _place(motion: Motion) -> NDArray | None:
    if motion.path is None or motion.middle is None:
        return None
    return motion.path - motion.middle


def _time(motion: Motion) -> NDArray:
    return (motion.time - motion.time.mean())[:, None]


def _input(motion: Motion) -> NDArray:
    return motion.inputs / motion.largest


_FAMILIES: tuple[tuple[str, str, Callable[[Motion], NDArray | None]], ...] = (
    ("heading", "follows the heading, as a constant force in the world does", _heading),
    ("direction of travel", "has the sign of the direction of travel", _direction),
    ("speed", "follows the speed", _speed),
    ("place", "follows the place on the floor", _place),
    ("time", "grows steadily over the run", _time),
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
    """How much of the missing force each pattern reproduces, best first. `seen[e]` belongs to `forces[e]`."""
    values = [force.force / force.scale for force in forces]
    whole = float(sum(np.sum(v**2) for v in values))
    if not whole > 0:
        return ()
    rng = np.random.default_rng(_SEED)
    edges = np.cumsum([len(v) for v in values])[:-1]
    found = []
    for name, phrase, family in _FAMILIES:
        columns = [family(motion) for motion in seen]
        if any(column is None for column in columns):
            continue
        basis, scales, _ = np.linalg.svd(np.concatenate(columns), full_matrices=False)  # type: ignore[arg-type]
        basis = basis[:, scales > 1e-9 * max(scales[0], 1e-300)]
        at_places = np.split(basis, edges)
        products = sum(b.T @ v for b, v in zip(at_places, values, strict=True))
        squares = np.concatenate([[np.sum(products**2)], _moved_squares(at_places, values, rng)]) / whole
        chance = float(np.mean(squares[1:]))
        p_value = (1.0 + np.count_nonzero(squares[1:] >= squares[0])) / (1.0 + _SHIFTS)
        share = float((squares[0] - chance) / max(1 - chance, 1e-9))
        fitted = basis @ products * forces[0].scale
        found.append(Pattern(name, phrase, share, float(p_value), tuple(np.split(fitted, edges))))
    return tuple(sorted(found, key=lambda pattern: -pattern.share))
