"""A mechanism's curve as it was found: what the missing thing is as a function of one variable."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..effects.curve import Curve
from ..estimate.result import Estimate


@dataclass(frozen=True)
class Shape:
    """A curve of `variable` [`of`]: `values` [`unit`] at `points`, with 95 % intervals (`band`), straight between the points
    and level beyond them."""

    variable: str
    of: str
    unit: str
    points: tuple[float, ...]
    values: tuple[float, ...]
    band: tuple[tuple[float, float], ...]

    @property
    def sentence(self) -> str:
        """The points in a sentence."""
        unit, of = (f" {u}" if u else "" for u in (self.unit, self.of))
        pairs = zip(self.points, self.values, strict=True)
        return ", ".join(f"{value:.3g}{unit} at {point:.3g}{of}" for point, value in pairs)

    def to_dict(self) -> dict:
        """What `explanation.json` holds."""
        return {
            "variable": self.variable,
            "of": self.of,
            "unit": self.unit,
            "points": list(self.points),
            "values": list(self.values),
            "band": [list(ends) for ends in self.band],
        }


def shape_of(curve: Curve, found: Mapping[str, Estimate]) -> Shape:
    """The curve of a fit whose parameters are `found`."""
    reach = found[curve.key("reach")]
    heights = {place: found[curve.key(f"at_{k + 1}")] for k, place in enumerate(curve.free)}
    unit = next(iter(heights.values())).unit
    none = Estimate(0.0, 0.0, (0.0, 0.0), unit, "fixed")
    every = [heights.get(k, none) for k in range(len(curve.knots))]
    ends = [tuple(float(end) if math.isfinite(end) else math.nan for end in e.ci95) for e in every]
    return Shape(
        variable=curve.variable,
        of=reach.unit,
        unit=unit,
        points=tuple(share * reach.value for share in curve.knots),
        values=tuple(e.value for e in every),
        band=tuple((low, high) for low, high in ends),
    )
