"""One effect that an explanation has added to a model: its name, its sizes, and why it is believed."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._distributions import chi_squared_tail, normal_tail
from ..estimate.result import Estimate, Fit
from ..robots.effect import Effect, in_words
from .where.shape import Shape

TABLE_CONSTANTS = "table_constants"
"""What stands among the names that the data cannot tell from an effect where wrong constants of the table would do the same."""
_SIGNIFICANT = 2.0
"""Standard errors by which an effect's strength must differ from none."""


@dataclass(frozen=True)
class Evidence:
    """Why an effect was added.

    Held-out normalised RMS `before` and `after` it, the drop of chi-squared on the fitted logs (`fit_gain`) and on the
    held-out ones (`held_out_gain`), how many candidates were looked at and refitted, and how far the next distinguishable
    candidate lies behind (`runner_up`, `margin` in chi-squared; None if none was refitted).
    """

    before: float
    after: float
    fit_gain: float
    held_out_gain: float
    looked_at: int
    refitted: int
    runner_up: str | None
    margin: float | None


@dataclass(frozen=True)
class NamedEffect:
    """One effect that was added, with the ids this data cannot tell from it in `equivalent_to`.

    `law` is the law of the mechanism that explains best ("shape" for a curve without a formula, whose points `shapes` holds;
    "" where the mechanism has one law only) and `laws_alike` are those that this data cannot tell from it.

    `constants` are sets of constants of the robot's table, each with the share of its value, that would do the same if they
    were wrong by it; "table_constants" then stands in `equivalent_to`. Of an effect that is such constants they are its own,
    and then others that do the same.

    `identified`: whether the data says that it is there, by the errors of its strengths (`differs_from_nothing`).
    """

    id: str
    where: str
    formula: str
    parameters: dict[str, Estimate]
    equivalent_to: tuple[str, ...]
    evidence: Evidence
    identified: bool = True
    law: str = ""
    laws_alike: tuple[str, ...] = ()
    shapes: tuple[Shape, ...] = ()
    constants: tuple[Mapping[str, float], ...] = ()

    def as_in(self, final: Fit) -> "NamedEffect":
        """The same with the estimates of a fit whose standard errors have become wider."""
        effect = next(own for own in final.robot.effects if own.id == self.id)
        return replace(self, parameters=effect_parameters(self.id, effect.frees(final.robot), final.parameters))

    def or_constants(self, found: Sequence[Mapping[str, float]]) -> "NamedEffect":
        """The same, not told apart from wrong `constants` of the table where any are found: by how much, as shares."""
        others = (*self.equivalent_to, TABLE_CONSTANTS) if found else self.equivalent_to
        return replace(self, equivalent_to=others, constants=tuple(found))

    @property
    def title(self) -> str:
        """The id as words; of constants of the table, what they are."""
        if self.id == TABLE_CONSTANTS:
            others = [" and ".join(own) for own in self.constants[1:]]
            others = f" (or of {' or '.join(others)})" if others else ""
            return f"the right value of {' and '.join(self.parameters)}{others}"
        return in_words(self.id)

    @property
    def law_in_words(self) -> str:
        """The law, and those that the data cannot tell from it; empty where the mechanism has one only."""
        if self.shapes:
            curves = "; ".join(shape.sentence for shape in self.shapes)
            return f"by none of the listed laws but by this curve of {self.shapes[0].variable}: {curves}"
        if not self.law:
            return ""
        others = f" (or {', '.join(map(in_words, self.laws_alike))}, which this data cannot tell apart)"
        return f"by the law {in_words(self.law)}{others if self.laws_alike else ''}"

    @property
    def sentence(self) -> str:
        """Name, size and evidence in one sentence."""
        sizes = ", ".join(_worded(name, e) for name, e in self.parameters.items() if e.status != "fixed")
        sizes = self.law_in_words if self.shapes else ", ".join(filter(None, (sizes, self.law_in_words)))
        text = f"{self.title[0].upper()}{self.title[1:]} ({self.where}): {sizes}; "
        text += f"held-out error {self.evidence.before:.2f} to {self.evidence.after:.2f} times the noise."
        if self.equivalent_to:
            others = " or ".join(map(in_words, self.equivalent_to))
            text += f" This data cannot tell it from {others}."
        elif self.evidence.runner_up:
            text += f" Next best was {in_words(self.evidence.runner_up)}."
        return text

    def to_dict(self) -> dict[str, Any]:
        """As in `explanation.json`."""
        evidence = self.evidence
        return {
            "id": self.id,
            "where": self.where,
            "formula": self.formula,
            "law": self.law,
            "laws_alike": list(self.laws_alike),
            "shape": [shape.to_dict() for shape in self.shapes],
            "equivalent_to": list(self.equivalent_to),
            "constants": [dict(own) for own in self.constants],
            "parameters": {name: estimate.to_dict() for name, estimate in self.parameters.items()},
            "evidence": {
                "held_out_before": evidence.before,
                "held_out_after": evidence.after,
                "chi_squared_gain_fit": evidence.fit_gain,
                "chi_squared_gain_check": evidence.held_out_gain,
                "candidates_looked_at": evidence.looked_at,
                "candidates_refitted": evidence.refitted,
                "runner_up": evidence.runner_up,
                "runner_up_behind_by": evidence.margin,
            },
            "sentence": self.sentence,
        }


def _worded(name: str, estimate: Estimate) -> str:
    unit = f" {estimate.unit}" if estimate.unit else ""
    if not math.isfinite(estimate.std_error):
        return f"{name.replace('_', ' ')} {estimate.value:.3g}{unit} ({estimate.status.replace('_', ' ')})"
    return f"{name.replace('_', ' ')} {estimate.value:.3g} ± {estimate.std_error:.1g}{unit}"


def differs_from_nothing(effect: Effect, baseline: Fit, final: Fit) -> bool:
    """Whether the errors of the effect's strengths exclude that there is no such effect.

    Strengths are the parameters that begin at zero, at which there is no such effect, and those of the robot that it frees,
    from the baseline's values; where or when an effect acts (a speed, a line, a period) says nothing. One strength may do,
    even where the data bounds it from one side only, or several together by their covariance (Wald's test), as sine and
    cosine of a ripple do whose phase is vague.
    """
    before, after = baseline.robot, final.robot
    bare = replace(after, effects=tuple(other for other in after.effects if other.id != effect.id))
    begin = {name: p.value for name, p in effect.parameters(bare).items()}
    strengths = dict.fromkeys([name for name, value in begin.items() if value == 0.0] or begin, 0.0)
    strengths |= {name: before.parameters[name].value for name in effect.frees(bare) if name in before.parameters}
    off = {n: final[n].value - none for n, none in strengths.items() if n in final.free_names}
    for name, distance in off.items():
        estimate, none = final[name], final[name].value - distance
        low, high = estimate.ci95
        if estimate.status == "identified" and abs(distance) > _SIGNIFICANT * estimate.std_error:
            return True
        if estimate.status == "not_identifiable" and math.isinf(estimate.std_error) and (low > none or high < none):
            return True
    together = [n for n in off if final[n].status in ("identified", "not_identifiable")]
    places = [final.free_names.index(n) for n in together]
    covariance = np.asarray(final.covariance, float)[np.ix_(places, places)]
    if len(together) < 2 or not np.isfinite(covariance).all() or np.linalg.matrix_rank(covariance) < len(together):
        return False
    step = np.array([off[n] for n in together])
    p_value = chi_squared_tail(float(step @ np.linalg.solve(covariance, step)), len(together))
    return bool(p_value < 2.0 * normal_tail(_SIGNIFICANT))


def effect_parameters(identifier: str, frees: tuple[str, ...], found: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """An effect's own parameters of a fit by their short names; a limit beside its inverse."""
    own: dict[str, Estimate] = {}
    for name, estimate in found.items():
        short = name.removeprefix(f"{identifier}.")
        if short == name and name not in frees:
            continue
        own[short] = estimate
        if short.startswith("inverse_") and estimate.value > 0:
            value, (low, high) = 1.0 / estimate.value, estimate.ci95
            unit = estimate.unit.removeprefix("1/")
            ends = (1.0 / high if high > 0 else math.nan, 1.0 / low if low > 0 else math.inf)
            limit = Estimate(value, estimate.std_error * value**2, ends, unit, estimate.status)
            own = {short.removeprefix("inverse_"): limit, **own}
    return own
