"""Where a model and its logs disagree: in which channel, in which equation of motion, and under which conditions.

The gap on held-out logs is split by channel; the missing force (`missing_force`) by equation and by condition
(`conditions`). A condition stands out where it holds far more of the missing force's power than of the time, and more
than it would if the force had come at another moment of the same runs (circular shifts of the power against the
conditions, which keep how long both last).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..estimate.result import Fit
from ..logs import LogSet
from .conditions import Mask, conditions_of, motions
from .heldout import HeldOut
from .missing_force import ForceHistory, missing_force
from .patterns import Pattern, patterns

FALSE_ALARM = 0.05
"""How often any condition at all is said to stand out although the force comes at random moments."""
LEAST_RATIO = 1.25
"""Share of the force over share of the time below which a condition is not worth naming."""
_LEAST_SHARE = 0.15
_LEAST_TIME = 0.01
_SHIFTS = 4000
_RESAMPLES = 1000
_BLOCK = 1.0  # s: neighbouring samples of a force are correlated
_MOSTLY = 0.6
_MOST = 0.8
_BURSTS = 0.12
"""Share of the time below which a force that holds `_MOST` of its power in it is called bursts."""
_SEED = 20

WORDS = {
    "eta1": "forward speed",
    "eta2": "yaw rate",
    "V": "forward speed",
    "Vn": "sideways speed",
    "W": "yaw rate",
    "v": "speed",
}
"""What the standard channels measure, for sentences."""


@dataclass(frozen=True)
class ConditionShare:
    """How much of the missing force acts under one condition.

    `share` of its power (above what its own uncertainty explains), `time_share` of the samples, their `ratio` with a
    95 % interval (bootstrap over blocks of one second), and `p_value`: how often forces at random moments of the same
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


@dataclass(frozen=True)
class Localisation:
    """Where the gap is.

    - `gap_share`: share by channel of the squared held-out residuals above the noise floor.
    - `force_share`: share by equation of the missing force's power, forces of different units compared by the change of
      speed that they cause in units of its noise.
    - `conditions`: one `ConditionShare` each, those that tell most about the force first.
    - `patterns`: what the force varies with (heading, speed, ...), best first.
    - `concentration`: the smallest share of the time that holds 80 % of the power; small for pushes and collisions.
    - `stages`: share of the gap that the best candidate of each stage of the signal path promises to explain, where given.
    - `units` of the forces by equation. For figures: `forces`, the missing force of every log, and `marked`, the samples
      of every log under the condition that stands out most (none where nothing does).
    - `sentence`: all of this in plain English.
    """

    gap_share: dict[str, float]
    force_share: dict[str, float]
    conditions: tuple[ConditionShare, ...]
    patterns: tuple[Pattern, ...]
    concentration: float
    stages: dict[str, float]
    sentence: str
    units: dict[str, str]
    forces: tuple[ForceHistory, ...] = field(repr=False)
    marked: tuple[Mask, ...] = field(repr=False, default=())

    @property
    def standing_out(self) -> tuple[ConditionShare, ...]:
        """Conditions that stand out, the most telling first."""
        return tuple(condition for condition in self.conditions if condition.stands_out)

    def to_dict(self) -> dict:
        """Plain numbers and strings, for `explanation.json`; the forces over time are left out."""
        return {
            "sentence": self.sentence,
            "gap_share": dict(self.gap_share),
            "force_share": dict(self.force_share),
            "stages": dict(self.stages),
            "concentration": self.concentration,
            "patterns": [{"name": p.name, "share": p.share, "p_value": p.p_value} for p in self.patterns],
            "conditions": [
                {
                    "name": c.name,
                    "share": c.share,
                    "time_share": c.time_share,
                    "ratio": c.ratio,
                    "ratio_ci95": list(c.ratio_ci95),
                    "p_value": c.p_value,
                    "stands_out": c.stands_out,
                    "mean_force": {n: {"value": v, "unit": self.units[n]} for n, v in c.mean_force.items()},
                }
                for c in self.conditions
            ],
        }


def gap_shares(held: HeldOut) -> dict[str, float]:
    """Share by channel of the squared residuals above the noise floor; empty where none is above it."""
    pooled = np.concatenate(held.residuals)
    excess = np.maximum(np.nansum(pooled**2, axis=0) - np.sum(np.isfinite(pooled), axis=0), 0.0)
    if not excess.sum() > 0:
        return {}
    return {name: float(e / excess.sum()) for name, e in zip(held.by_channel, excess, strict=True)}


def power(force: ForceHistory) -> NDArray[np.float64]:
    """Squared missing force [T, n] above its own variance, in units of `scale` squared, so that equations compare."""
    return np.maximum(force.force**2 - force.std**2, 0.0) / force.scale**2


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


def _ratio_interval(masks, powers, lengths: Sequence[int], rng: np.random.Generator) -> tuple[float, float]:
    """95 % interval of (share of power) / (share of time), from blocks drawn with replacement."""
    inside = _blocks([np.where(m, own, 0.0) for m, own in zip(masks, powers, strict=True)], lengths)
    every, time = _blocks(powers, lengths), _blocks([m.astype(float) for m in masks], lengths)
    samples = _blocks([np.ones(len(m)) for m in masks], lengths)
    weights = rng.multinomial(len(every), np.full(len(every), 1.0 / len(every)), _RESAMPLES)
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
    lengths = [max(1, round(_BLOCK / float(np.median(np.diff(force.time))))) for force in forces]
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
        interval = _ratio_interval(own, powers, lengths, rng)
        mean = {n: float(v) for n, v in zip(forces[0].names, values[pooled].mean(axis=0), strict=True)}
        row = ConditionShare(name, phrase, share, time_share, ratio, interval, float(p_value), False, mean)
        # As many conditions were looked at as stand in the table (Bonferroni).
        found.append(replace(row, stands_out=row.notable and p_value < FALSE_ALARM / len(used)))
    return tuple(sorted(found, key=lambda c: (not c.stands_out, -c.contrast if c.ratio > 1 else c.contrast)))


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def channel_name(channel: str) -> str:
    """The channel in words, with its symbol."""
    return f"{WORDS[channel]} {channel}" if channel in WORDS else channel


def _where(shares: Mapping[str, float]) -> str:
    """The part of the sentence that says in which channel the gap is."""
    ordered = sorted(shares.items(), key=lambda item: -item[1])
    if len(ordered) == 1:
        return f"The gap is in {channel_name(ordered[0][0])}"
    if ordered[0][1] >= _MOSTLY:
        return f"{_percent(ordered[0][1])} of the gap is in {channel_name(ordered[0][0])}"
    parts = [f"{channel_name(name)} ({_percent(share)})" for name, share in ordered]
    return f"The gap is spread over {', '.join(parts[:-1])} and {parts[-1]}"


def concentration(powers: NDArray[np.float64]) -> float:
    """Smallest share of the samples that holds 80 % of the power (NaN without power)."""
    ordered = np.cumsum(np.sort(powers)[::-1])
    if not ordered[-1] > 0:
        return float("nan")
    return float((np.searchsorted(ordered, _MOST * ordered[-1]) + 1) / len(ordered))


def _when(conditions: Sequence[ConditionShare], best: Sequence[Pattern], concentrated: float) -> str:
    """The part of the sentence that says how the missing force acts."""
    if not conditions:
        return "no missing force rises above its own uncertainty, so the gap cannot be placed"
    follows = next((p for p in best if p.stands_out), None)
    if follows:
        return f"{_percent(follows.share)} of the missing force {follows.phrase}"
    out = next((c for c in conditions if c.stands_out), None)
    if out:
        return f"{_percent(out.share)} of the missing force acts {out.phrase} ({_percent(out.time_share)} of the time)"
    if concentrated < _BURSTS:
        return (
            f"the missing force comes in bursts, {_percent(_MOST)} of it in {_percent(concentrated)} of the time, and no "
            "condition stands out"
        )
    near = next((c for c in conditions if c.notable), None)
    if near:
        return (
            f"no condition stands out for certain: {_percent(near.share)} of the missing force acts {near.phrase} "
            f"({_percent(near.time_share)} of the time), which may be chance"
        )
    return "no condition stands out: the missing force acts about as much under one as under another"


def sentence(
    held: HeldOut,
    shares: Mapping[str, float],
    conditions: Sequence[ConditionShare],
    best: Sequence[Pattern],
    concentrated: float,
    stages: Mapping[str, float],
) -> str:
    """Where the gap is, in plain English with numbers; says so where there is none or nothing stands out."""
    if held.adequate or not shares:
        return (
            f"Nothing stands out: on held-out logs the residual is at the noise floor "
            f"({held.normalised_rms:.2f} times the noise)."
        )
    text = f"{_where(shares)}; {_when(conditions, best, concentrated)}."
    positive = {name: share for name, share in stages.items() if share > 0}
    if positive:
        first = max(positive, key=lambda name: positive[name])
        text += (
            f" At the stage '{first}' of the signal path the best candidate promises {_percent(positive[first])} of it."
        )
    return text


def localise(fit: Fit, logs: LogSet, held: HeldOut, stages: Mapping[str, float] | None = None) -> Localisation:
    """Where the model of `fit` falls short.

    `logs` are those on which the missing force is estimated (usually the logs fitted), `held` the residuals on held-out
    logs. `stages` may hold the share of the gap that the best candidate of each stage promises to explain; it is kept.
    Raises `NoVelocities` for a robot that does not say which states its forces accelerate.
    """
    forces = missing_force(fit.robot, logs, held.noise, fit.initial_states)
    seen = motions(fit.robot, logs)
    masks = {(c.name, c.phrase): [c.holds(motion) for motion in seen] for c in conditions_of(seen[0])}
    conditions = condition_shares(forces, masks)
    following = patterns(forces, seen)
    every = np.concatenate([power(force) for force in forces])
    by_equation, concentrated = every.sum(axis=0), concentration(every.sum(axis=1))
    whole = float(by_equation.sum())
    names = forces[0].names
    shares = gap_shares(held)
    given = {name: float(share) for name, share in (stages or {}).items()}
    return Localisation(
        gap_share=shares,
        force_share={n: float(v / whole) if whole > 0 else 0.0 for n, v in zip(names, by_equation, strict=True)},
        conditions=conditions,
        patterns=following,
        concentration=concentrated,
        stages=given,
        sentence=sentence(held, shares, conditions, following, concentrated, given),
        units=dict(zip(names, forces[0].units, strict=True)),
        forces=forces,
        marked=next((tuple(masks[c.name, c.phrase]) for c in conditions if c.stands_out), ()),
    )
