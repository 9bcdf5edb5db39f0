"""What the missing force is a function of: heading, direction of travel, speed, yaw rate, place, time or input, or two of them.

Conditions tell when a force is large; a force such as a slope's is as large under all of them and only changes its
sign. Each pattern is a few functions of a log's `Motion`; the share of the missing force that their linear combination
reproduces, less what it reproduces of forces moved to random moments of the same runs, says how well it fits.

A model that lacks something has wrong parameters for it, so that the missing force holds shares of the speeds, of the signs
of travel and of the inputs besides. What of the force these make is nobody's: patterns are compared by what they reproduce
of the rest.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import prev_fast_len

from .conditions import Motion
from .missing_force import ForceHistory
from .pattern_functions import BY_LOG, FAMILIES, PRODUCTS, Functions, in_each, of_parameters
from .swings import swing

_SHIFTS = 400
_SEED = 21
LEAST_SHARE = 0.5
"""Share of the missing force that a pattern must reproduce to be named."""
SOME_SHARE = 1.0 / 3.0
"""The same where no condition tells more."""
FALSE_ALARM = 0.01
_PAIRED = 4
"""Patterns of which all pairs are tried."""
_FOR_TWO = 0.15
"""Share of the force by which a pair must reproduce more than one pattern."""
_LEFT = 1e-6
"""Share of a function's size that must be left of it beside others, to be more than rounding."""


@dataclass(frozen=True)
class Pattern:
    """`share` of the mean square of the missing force that `name` reproduces, but for what wrong parameters make of it and
    chance; `p_value` of that chance.

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


def telling(found: Sequence[Pattern]) -> Pattern | None:
    """What reproduces most of the missing force, if that is a good part of it and more than chance does."""
    best = max(found, key=lambda pattern: pattern.share, default=None)
    return best if best is not None and best.share >= SOME_SHARE and best.p_value < FALSE_ALARM else None


def answering(found: Sequence[Pattern]) -> Pattern | None:
    """What the missing force follows: what reproduces most of it, of those that stand out."""
    return max((pattern for pattern in found if pattern.stands_out), key=lambda own: own.share, default=None)


def _moved_squares(basis: list[NDArray], values: list[NDArray], rng: np.random.Generator) -> NDArray:
    """Sum of squares that an orthonormal basis reproduces of forces shifted by random times in every log [_SHIFTS]."""
    products = np.zeros((_SHIFTS, basis[0].shape[1], values[0].shape[1]))
    for b, v in zip(basis, values, strict=True):
        n = prev_fast_len(len(v), real=True)  # a log of a prime number of samples would take ten times as long
        spectrum = np.fft.rfft(b[:n], axis=0)[:, :, None] * np.conj(np.fft.rfft(v[:n], axis=0))[:, None, :]
        products += np.fft.irfft(spectrum, n, axis=0)[rng.integers(0, n, _SHIFTS)]
    return np.sum(products**2, axis=(1, 2))


_OWN: dict[str, tuple[str, ...]] = {
    "speed": ("direction of travel", "speed"),
    "direction of travel": ("direction of travel",),
}
"""What a pattern is itself a function of, among what wrong parameters make."""


def patterns(forces: Sequence[ForceHistory], seen: Sequence[Motion]) -> tuple[Pattern, ...]:
    """How much of the missing force each pattern reproduces, best first. Of two together, the pair that reproduces most where
    that is more by `_FOR_TWO` than the best alone, those of which one changes what the other makes where it is more than
    either, and what differs between logs where that is more than all. `seen[e]` belongs to `forces[e]`."""
    values = [force.force / force.scale for force in forces]
    if not sum(np.sum(v**2) for v in values) > 0:
        return ()
    scale = forces[0].scale

    def judged(name: str, phrase: str, columns: Sequence[NDArray], parts: Sequence[str]) -> Pattern:
        own = {other for part in parts for other in _OWN.get(part, (part,))}
        besides = [of_parameters(motion, sorted(own)) for motion in seen]
        if "time" in parts:  # what is the same all the time does not change over the run
            besides = [np.column_stack([other, np.ones(len(other))]) for other in besides]
        return _pattern(name, phrase, columns, besides, values, scale)

    def known(of: Functions) -> list[NDArray] | None:
        columns = [own for own in map(of, seen) if own is not None]
        return columns if len(columns) == len(seen) else None

    by_name = {name: (phrase, own) for name, phrase, of in FAMILIES if (own := known(of)) is not None}
    alone = {name: judged(name, phrase, columns, [name]) for name, (phrase, columns) in by_name.items()}
    besides = [of_parameters(motion, []) for motion in seen]
    found = [*alone.values(), *_swinging(values, besides, seen, scale)]
    found.sort(key=lambda own: -own.share)
    if found[0].share > 1.0 - _FOR_TWO:
        return tuple(found)  # nothing reproduces so much more
    together = []
    for first, second in itertools.combinations([own.name for own in found if own.name in alone][:_PAIRED], 2):
        both = [np.column_stack(each) for each in zip(by_name[first][1], by_name[second][1], strict=True)]
        phrase = f"{by_name[first][0]}, and {by_name[second][0]}"
        together.append(judged(f"{first} and {second}", phrase, both, [first, second]))
    best = max(together, key=lambda pair: pair.share, default=None)
    if best is not None and best.share > found[0].share + _FOR_TWO:
        found.append(replace(best, pair=True))
    changing = []
    for name, parts, phrase, of in PRODUCTS:
        if (columns := known(of)) is not None:
            # Of what wrong parameters make nothing is its own: they make what it changes.
            product = judged(name, phrase, columns, [])
            if product.share > max(alone[part].share for part in parts if part in alone) + _FOR_TWO:
                changing.append(product)
    found = sorted([*found, *changing], key=lambda own: -own.share)
    # What changes with the place or the time differs between logs, too.
    by_log = [judged(name, phrase, in_each(of, seen), []) for name, phrase, of in BY_LOG if len(seen) > 1]
    best = max(by_log, key=lambda product: product.share, default=None)
    if best is not None and best.share > found[0].share + _FOR_TWO:
        found.insert(0, best)
    return tuple(found)


def _swinging(
    values: list[NDArray], besides: list[NDArray], seen: Sequence[Motion], scale: NDArray[np.float64]
) -> list[Pattern]:
    """The pattern of a force that swings by itself, if there is a band of frequencies that could be one."""
    edges = np.cumsum([len(v) for v in values])[:-1]
    makes, rest = _parted(_orthonormal(np.concatenate(besides)), np.concatenate(values))
    found = swing(np.split(rest, edges), besides, [motion.time for motion in seen])
    if found is None:
        return []
    phrase = (
        f"swings with a period of about {found.period:.2g} s whatever drives the robot, as a load that hangs, a soft joint or "
        "something that turns does"
    )
    fitted = [(own + part) * scale for own, part in zip(np.split(makes, edges), found.part, strict=True)]
    return [Pattern("period of its own", phrase, found.share, found.p_value, tuple(fitted))]


def _pattern(
    name: str,
    phrase: str,
    columns: Sequence[NDArray],
    besides: Sequence[NDArray],
    values: list[NDArray],
    scale: NDArray[np.float64],
) -> Pattern:
    """What the sums of a pattern's `columns` [T, k] of every log reproduce of the forces `values` [T, n], but for what those
    `besides` do."""
    rng = np.random.default_rng(_SEED)
    edges = np.cumsum([len(v) for v in values])[:-1]
    others = _orthonormal(np.concatenate(besides))
    makes, rest = _parted(others, np.concatenate(values))
    pattern = np.concatenate(columns)
    size = np.linalg.norm(pattern, axis=0)
    pattern = _parted(others, pattern)[1]
    pattern = pattern[:, np.linalg.norm(pattern, axis=0) > _LEFT * size]
    left = float(np.sum(rest**2))
    if not pattern.shape[1] or not left > 0:
        return Pattern(name, phrase, 0.0, 1.0, tuple(np.split(makes * scale, edges)))
    basis = _orthonormal(pattern)
    products = basis.T @ rest
    moved = _moved_squares(np.split(basis, edges), np.split(rest, edges), rng)
    squares = np.concatenate([[np.sum(products**2)], moved]) / left
    chance = float(np.mean(squares[1:]))
    p_value = (1.0 + np.count_nonzero(squares[1:] >= squares[0])) / (1.0 + _SHIFTS)
    share = float((squares[0] - chance) / max(1 - chance, 1e-9))
    fitted = (makes + basis @ products) * scale
    return Pattern(name, phrase, share, float(p_value), tuple(np.split(fitted, edges)))


def _parted(basis: NDArray, values: NDArray) -> tuple[NDArray, NDArray]:
    """What an orthonormal basis makes of values [T, n], and the rest."""
    made = basis @ (basis.T @ values)
    return made, values - made


def _orthonormal(columns: NDArray) -> NDArray:
    """Orthonormal columns that span the same, without what is nothing but rounding."""
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0] / size[size > 0]
    basis, scales, _ = np.linalg.svd(columns, full_matrices=False)
    return basis[:, scales > _LEFT * max(scales, default=1.0)]
