"""What the missing force varies with: heading, direction of travel, speed, place, time or input.

Conditions tell when a force is large; a force such as a slope's is as large under all of them and only changes its
sign. Each pattern is a few functions of a log's `Motion`; the share of the missing force that their linear combination
reproduces, less what it reproduces of forces moved to random moments of the same runs, says how well it fits.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

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
    """`share` of the missing force's mean square that `name` reproduces, chance taken off; `p_value` of that chance."""

    name: str
    phrase: str
    share: float
    p_value: float

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


def patterns(forces: Sequence[ForceHistory], seen: Sequence[Motion]) -> tuple[Pattern, ...]:
    """How much of the missing force each pattern reproduces, best first. `seen[e]` belongs to `forces[e]`."""
    values = [force.force / force.scale for force in forces]
    whole = float(sum(np.sum(v**2) for v in values))
    if not whole > 0:
        return ()
    rng = np.random.default_rng(_SEED)
    shifts = [rng.integers(0, len(v), _SHIFTS) for v in values]
    moved = [
        [np.roll(v, shift, axis=0) for v, shift in zip(values, row, strict=True)] for row in zip(*shifts, strict=True)
    ]
    stacked = np.concatenate([np.concatenate(values), *(np.concatenate(row) for row in moved)], axis=1)
    found = []
    for name, phrase, family in _FAMILIES:
        columns = [family(motion) for motion in seen]
        if any(column is None for column in columns):
            continue
        basis, scales, _ = np.linalg.svd(np.concatenate(columns), full_matrices=False)  # type: ignore[arg-type]
        basis = basis[:, scales > 1e-9 * max(scales[0], 1e-300)]
        squares = np.sum((basis.T @ stacked) ** 2, axis=0).reshape(1 + _SHIFTS, -1).sum(axis=1) / whole
        chance = float(np.mean(squares[1:]))
        p_value = (1.0 + np.count_nonzero(squares[1:] >= squares[0])) / (1.0 + _SHIFTS)
        found.append(Pattern(name, phrase, float((squares[0] - chance) / max(1 - chance, 1e-9)), float(p_value)))
    return tuple(sorted(found, key=lambda pattern: -pattern.share))
