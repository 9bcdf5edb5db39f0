"""Where a model and its logs disagree: in which channel, in which equation of motion, and under which conditions.

The gap on held-out logs is split by channel; the missing force (`missing_force`) by equation and by condition
(`condition_shares`), and compared with what it may follow (`patterns`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...estimate.result import Fit
from ...logs import LogSet
from ...robots.robot import Robot
from ..left.heldout import HeldOut
from .condition_shares import ConditionShare, condition_shares, power
from .conditions import Mask, conditions_of, motions
from .missing_force import ForceHistory, NoVelocities, forced, missing_force
from .patterns import Pattern, answering, patterns, telling

_MOSTLY = 0.6
_MOST = 0.8
_BURSTS = 0.12
"""Share of the time below which a force that holds `_MOST` of its power in it is called bursts."""


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


def _percent(share: float) -> str:
    rounded = f"{100 * share:.0f} %"
    return "less than 1 %" if share > 0 and rounded == "0 %" else rounded


def channel_name(channel: str, words: Mapping[str, str]) -> str:
    """The channel in the robot's words, with its symbol unless that is one of them."""
    said = words.get(channel, channel)
    return said if channel in said.split() else f"{said} {channel}"


def _where(shares: Mapping[str, float], words: Mapping[str, str]) -> str:
    """The part of the sentence that says in which channel the gap is."""
    ordered = sorted(shares.items(), key=lambda item: -item[1])
    if len(ordered) == 1:
        return f"The gap is in {channel_name(ordered[0][0], words)}"
    if ordered[0][1] >= _MOSTLY:
        return f"{_percent(ordered[0][1])} of the gap is in {channel_name(ordered[0][0], words)}"
    parts = [f"{channel_name(name, words)} ({_percent(share)})" for name, share in ordered]
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
    follows = answering(best)
    out = next((c for c in conditions if c.stands_out), None)
    alone = next((p for p in best if p.stands_out and not p.pair), None)
    # A condition is easier to grasp than two patterns together, neither of which stands out alone.
    if follows and not (follows.pair and out and not alone):
        one = f" ({_percent(alone.share)} the {alone.name} alone)" if follows.pair and alone else ""
        return f"{_percent(follows.share)} of the missing force {follows.phrase}{one}"
    if out:
        return f"{_percent(out.share)} of the missing force acts {out.phrase} ({_percent(out.time_share)} of the time)"
    if concentrated < _BURSTS:
        return (
            f"the missing force comes in bursts, {_percent(_MOST)} of it in {_percent(concentrated)} of the time, and no "
            "condition stands out"
        )
    some = telling(best)
    if some:
        return f"{_percent(some.share)} of the missing force {some.phrase}"
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
    words: Mapping[str, str],
) -> str:
    """Where the gap is, in plain English with numbers; says so where there is none or nothing stands out."""
    if held.adequate or not shares:
        return (
            f"Nothing stands out: on held-out logs the residual is at the noise floor "
            f"({held.normalised_rms:.2f} times the noise)."
        )
    text = f"{_where(shares, words)}; {_when(conditions, best, concentrated)}."
    positive = {name: share for name, share in stages.items() if share > 0}
    if positive:
        first = max(positive, key=lambda name: positive[name])
        text += (
            f" At the stage '{first}' of the signal path the best candidate promises {_percent(positive[first])} of it."
        )
    return text


def without_place(robot: Robot) -> str:
    """A sentence if the gap of this robot's models cannot be placed: in a closed loop, or for want of velocities."""
    if robot.controlled:
        return (
            "The gap is not placed in an equation of motion, since the controller answers what is missing before it shows; an "
            "explanation of the plant at its logged commands places it."
        )
    try:
        forced(robot)
    except NoVelocities as error:
        return f"The gap cannot be placed in an equation of motion: {error}."
    return ""


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
        sentence=sentence(held, shares, conditions, following, concentrated, given, fit.robot.words),
        units=dict(zip(names, forces[0].units, strict=True)),
        forces=forces,
        marked=next((tuple(masks[c.name, c.phrase]) for c in conditions if c.stands_out), ()),
    )
