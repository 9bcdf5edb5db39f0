"""How much of the missing force acts under each condition, against chance.

A condition stands out where it holds far more of the missing force's power than of the time, and more than it would if
the force had come at another moment of the same runs (circular shifts of the force against the conditions, which keep
how long both last).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...estimate.result import NORMAL_95
from .conditions import Mask
from .missing_force import ForceHistory

FALSE_ALARM = 0.05
"""How often any condition at all is said to stand out although the force comes at random moments."""
LEAST_RATIO = 1.25
"""Share of the force over share of the time below which a condition is not worth naming."""
_LEAST_SHARE = 0.15
_LEAST_TIME = 0.01
_SHIFTS = 4000
_RESAMPLES = 1000
_BLOCKS = 12  # of a log: neighbouring samples of a force are correlated
_SEED = 20


@dataclass(frozen=True)
class ConditionShare:
    """How much of the missing force acts under one condition.

    `share` of its power (beyond its own 95 % band), `time_share` of the samples, their `ratio` with a
    95 % interval (bootstrap over twelfths of a log), and `p_value`: how often forces at random moments of the same
    runs have so large a share. `mean_force` by equation under the condition, in the force's unit.
    """

    name: str
    phrase: str
    share: float
    time_share: float
    ratio: float
    ratio_ci95: tuple[float, float]
    p_value: float
    stands_out: bool
    mean_force: dict[str, float]

    @property
    def notable(self) -> bool:
        """Whether the force is clearly stronger under the condition, chance in when it came left aside."""
        return self.ratio >= LEAST_RATIO and self.share >= _LEAST_SHARE and self.ratio_ci95[0] > 1.0

    @property
    def contrast(self) -> float:
        """Information [nat] that the condition gives about when the force acts (Kullback-Leibler divergence)."""
        total = 0.0
        for p, q in ((self.share, self.time_share), (1 - self.share, 1 - self.time_share)):
            total += p * float(np.log(max(p, 1e-12) / max(q, 1e-12)))
        return total


def power(force: ForceHistory) -> NDArray[np.float64]:
    """Squared missing force [T, n] beyond its own 95 % band, in units of `scale` squared, so that equations compare."""
    return np.maximum(force.force**2 - (NORMAL_95 * force.std) ** 2, 0.0) / force.scale**2


def _shifted_shares(masks: Sequence[Mask], powers: Sequence[NDArray], rng: np.random.Generator) -> NDArray[np.float64]:
    """Share of a signal under a condition when it is shifted in time by a random amount in every log [_SHIFTS]."""
    total = np.zeros(_SHIFTS)
    for mask, own in zip(masks, powers, strict=True):
        n = len(own)
        every = np.fft.irfft(np.conj(np.fft.rfft(own)) * np.fft.rfft(mask.astype(float)), n)
        total += every[rng.integers(0, n, _SHIFTS)]
    return total / sum(float(own.sum()) for own in powers)


def _blocks(values: Sequence[NDArray], lengths: Sequence[int]) -> NDArray[np.float64]:
    """Sums over blocks of `lengths` samples each, all logs one after the other."""
    return np.concatenate(
        [np.add.reduceat(own, np.arange(0, len(own), n)) for own, n in zip(values, lengths, strict=True)]
    )


def _ratio_interval(masks, powers, lengths: Sequence[int], weights: NDArray) -> tuple[float, float]:
    """95 % interval of (share of power) / (share of time); `weights` [draws, blocks] say how often each is drawn."""
    inside = _blocks([np.where(m, own, 0.0) for m, own in zip(masks, powers, strict=True)], lengths)
    every, time = _blocks(powers, lengths), _blocks([m.astype(float) for m in masks], lengths)
    samples = _blocks([np.ones(len(m)) for m in masks], lengths)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = (weights @ inside / (weights @ every)) / (weights @ time / (weights @ samples))
    ratios = ratios[np.isfinite(ratios)]
    if not ratios.size:
        return (float("nan"), float("nan"))
    return (float(np.quantile(ratios, 0.025)), float(np.quantile(ratios, 0.975)))


def condition_shares(
    forces: Sequence[ForceHistory], masks: Mapping[tuple[str, str], Sequence[Mask]]
) -> tuple[ConditionShare, ...]:
    """The table of conditions, most telling first. `masks[(name, phrase)]` holds one mask [T] for each force's log.

    Empty where the missing force is nowhere above its own uncertainty.
    """
    rng = np.random.default_rng(_SEED)
    powers = [power(force).sum(axis=1) for force in forces]
    whole, samples = sum(float(own.sum()) for own in powers), sum(len(own) for own in powers)
    if not whole > 0:
        return ()
    # Compared by size, not power, with chance: else one strong moment would decide.
    sizes = [np.sqrt(own) for own in powers]
    lengths = [max(1, round(len(force.time) / _BLOCKS)) for force in forces]
    blocks = len(_blocks(powers, lengths))
    weights = rng.multinomial(blocks, np.full(blocks, 1.0 / blocks), _RESAMPLES).astype(float)
    values = np.concatenate([force.force for force in forces])
    used = {
        key: own
        for key, own in masks.items()
        if _LEAST_TIME < sum(int(m.sum()) for m in own) / samples < 1 - _LEAST_TIME
    }
    found = []
    for (name, phrase), own in used.items():
        pooled = np.concatenate(own)
        share = float(np.concatenate(powers)[pooled].sum()) / whole
        time_share = float(np.mean(pooled))
        shifted = _shifted_shares(own, sizes, rng)
        actual = float(np.concatenate(sizes)[pooled].sum()) / sum(float(size.sum()) for size in sizes)
        p_value = (1.0 + np.count_nonzero(shifted >= actual)) / (1.0 + _SHIFTS)
        ratio = share / time_share
        interval = _ratio_interval(own, powers, lengths, weights)
        mean = {n: float(v) for n, v in zip(forces[0].names, values[pooled].mean(axis=0), strict=True)}
        row = ConditionShare(name, phrase, share, time_share, ratio, interval, float(p_value), False, mean)
        # As many conditions were looked at as stand in the table (Bonferroni).
        found.append(replace(row, stands_out=bool(row.notable and p_value < FALSE_ALARM / len(used))))
    return tuple(sorted(found, key=lambda c: (not c.stands_out, -c.contrast if c.ratio > 1 else c.contrast)))
