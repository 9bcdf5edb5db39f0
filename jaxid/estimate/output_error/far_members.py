"""Members of a fleet that are far from the others: another machine, another load, a worn or wrongly assembled one.

Each parameter's middle over the fleet is the median, its spread the median absolute deviation, which the far members do not
move. A member is far where its distance, in units of spread and standard error together, is larger than the largest one of
as many normally distributed members is in all but one of a hundred fleets, whatever the parameter: what that takes is drawn.
In a small fleet one member that is far from the mean of the others, in units of their scatter, is told by that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._distributions import student_tail
from ..result import Fit

FEWEST = 5
"""Members below which the spread of a fleet is not known and nothing is said."""
_FALSE_ALARM = 0.01
"""How often one of a fleet of members that are normally distributed is called far."""
_NORMAL_MAD = 1.482602218505602
_DRAWN = 20_000
"""Fleets of normally distributed members that are drawn to learn what chance does."""
_MOST_DRAWN = 64
"""Members of a drawn fleet at most; the largest of more of them is farther at most as often as there are more."""


@dataclass(frozen=True)
class FarMember:
    """A member's estimate `value` of `parameter` and the fleet's: `median`, and robust standard deviation `spread`.

    `distance` is that from the median in units of spread and the member's own standard error together, with its sign.
    """

    member: str
    parameter: str
    unit: str
    value: float
    std_error: float
    median: float
    spread: float
    distance: float

    @property
    def sentence(self) -> str:
        """What is far, from what, and by how much."""
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{self.member} is far from the others in {self.parameter}: {self.value:.4g} ± {self.std_error:.2g}{unit}, where "
            f"the fleet has a median of {self.median:.4g} and a spread of {self.spread:.2g}: {abs(self.distance):.3g} times "
            "spread and standard error together."
        )


def _distances(values: NDArray[np.float64], errors: NDArray[np.float64] | float = 0.0):
    """Median, spread and distances of members (last axis)."""
    count = values.shape[-1]
    median = np.median(values, axis=-1, keepdims=True)
    # A few values lie closer to their own median than to the distribution's: n / (n - 0.8).
    level = _NORMAL_MAD * count / (count - 0.8)
    spread = level * np.median(np.abs(values - median), axis=-1, keepdims=True)
    unit = np.hypot(spread, errors)
    return median, spread, (values - median) / np.where(unit > 0, unit, np.inf)


@cache
def _largest_by_chance(count: int) -> NDArray[np.float64]:
    """The largest distances in fleets of `count` normally distributed members, in rising order [_DRAWN]."""
    drawn = np.random.default_rng(0).normal(size=(_DRAWN, count))
    return np.sort(np.max(np.abs(_distances(drawn)[2]), axis=-1))


def _chance(distance: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Probability that the largest of `count` members is as far."""
    drawn = min(count, _MOST_DRAWN)
    beyond = _DRAWN - np.searchsorted(_largest_by_chance(drawn), np.abs(distance))
    return beyond / _DRAWN * count / drawn


def _beside_the_rest(values: NDArray[np.float64], errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Probability [N] that the farthest of as many is as far from the mean of all others, in units of their scatter (the
    externally studentised deviate; Cook & Weisberg 1982): far fewer members tell it than the median of their deviations.
    Of several, the farthest first, which then counts no more (Rosner, Technometrics 25, 1983)."""
    found, left = np.ones(len(values)), np.arange(len(values))
    while len(left) >= FEWEST:
        x, own = values[left], errors[left] ** 2
        n, mean = len(x), (x.sum() - x) / (len(x) - 1)
        scatter = (np.sum(x**2) - x**2 - (n - 1) * mean**2) / (n - 2)
        # The scatter is that of members whose errors are the others'; its own may be larger.
        more = np.maximum(own - (own.sum() - own) / (n - 1), 0.0)
        unit = np.sqrt(np.maximum(scatter, 0.0) * n / (n - 1) + more)
        away = np.abs(x - mean) / np.where(unit > 0, unit, np.inf)
        k = int(np.argmax(away))
        chance = float(np.minimum(2.0 * n * student_tail(away[k], n - 2), 1.0))
        found[left[k]] = chance
        if chance >= _FALSE_ALARM:
            break
        left = np.delete(left, k)
    return found


class OneParameter(NamedTuple):
    """A parameter's estimates by N sound members that have identified it."""

    members: Sequence[str]
    unit: str
    values: NDArray[np.float64]
    errors: NDArray[np.float64]


def too_few(sound: int, members: int) -> str:
    """Why none of the members is called far, where too few of their fits are sound; empty otherwise."""
    if sound >= FEWEST or members < 2:
        return ""
    return (
        f"Whether a member is far from the others is not judged: that takes {FEWEST} sound fits, and there "
        f"{'is' if sound == 1 else 'are'} {sound}."
    )


def far_members(fits: Mapping[str, Fit]) -> tuple[FarMember, ...]:
    """Those that are farther from the fleet than chance makes them, the farthest first.

    Only sound fits and identified parameters (and combinations that the logs determine) count and are judged, and only
    parameters that `FEWEST` members or more have identified.
    """
    sound = {name: fit for name, fit in fits.items() if fit.trustworthy}
    names = dict.fromkeys(name for fit in sound.values() for name in (*fit.free_names, *fit.combinations))
    every: dict[str, OneParameter] = {}
    for name in names:
        own = {m: fit[name] for m, fit in sound.items() if name in (*fit.free_names, *fit.combinations)}
        own = {m: e for m, e in own.items() if e.status == "identified" and np.isfinite([e.value, e.std_error]).all()}
        if own:
            numbers = (np.array([getattr(e, field) for e in own.values()]) for field in ("value", "std_error"))
            every[name] = OneParameter(tuple(own), next(iter(own.values())).unit, *numbers)
    return far_estimates(every)


def far_estimates(every: Mapping[str, OneParameter]) -> tuple[FarMember, ...]:
    """The same, of all parameters' estimates by name; those of fewer than `FEWEST` members do not count."""
    judged = {name: own for name, own in every.items() if len(own.members) >= FEWEST}
    found: list[FarMember] = []
    for name, (members, unit, values, errors) in judged.items():
        median, spread, distance = _distances(values, errors)
        # Two tests, each by half of the level.
        chance = 2.0 * np.minimum(_chance(distance, len(members)), _beside_the_rest(values, errors))
        for k in np.flatnonzero(chance * len(judged) < _FALSE_ALARM).tolist():
            numbers = (float(x) for x in (values[k], errors[k], median.item(), spread.item(), distance[k]))
            found.append(FarMember(members[k], name, unit, *numbers))
    return tuple(sorted(found, key=lambda far: -abs(far.distance)))
