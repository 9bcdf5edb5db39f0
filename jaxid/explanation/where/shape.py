"""A mechanism's curve as it was found: what the missing thing is as a function of one variable."""

from collections.abc import Mapping
from dataclasses import dataclass

from ...effects.curve import Curve
from ...estimate.result import Estimate
from ...robots.robot import Robot


@dataclass(frozen=True)
class Shape:
    """A curve of `variable` [`of`]: `values` [`unit`] at `points`, with 95 % intervals (`band`), cubic between the points
    (`effects.curve`) and level beyond them; of `name` (a motor, a channel) where each has its own."""

    name: str
    variable: str
    of: str
    unit: str
    points: tuple[float, ...]
    values: tuple[float, ...]
    band: tuple[tuple[float, float], ...]

    @property
    def known(self) -> tuple[bool, ...]:
        """Which heights the data tells: not those whose interval is wider than the largest of what is told of the curve."""
        half = [(high - low) / 2.0 for low, high in self.band]
        told = [abs(value) for value, width in zip(self.values, half, strict=True) if width < abs(value)]
        return tuple(width <= max(told) for width in half) if told else (True,) * len(half)

    @property
    def sentence(self) -> str:
        """The points in a sentence."""
        unit, of = (f" {u}" if u else "" for u in (self.unit, self.of))
        heights = (
            f"{value:.3g}{unit}" if known else "not told" for value, known in zip(self.values, self.known, strict=True)
        )
        text = ", ".join(f"{height} at {point:.3g}{of}" for height, point in zip(heights, self.points, strict=True))
        return f"{self.name}: {text}" if self.name else text

    def to_dict(self) -> dict:
        """What `explanation.json` holds."""
        return {
            "name": self.name,
            "variable": self.variable,
            "of": self.of,
            "unit": self.unit,
            "points": list(self.points),
            "values": list(self.values),
            "band": [list(ends) for ends in self.band],
        }


def shapes_of(curve: Curve, robot: Robot, found: Mapping[str, Estimate]) -> tuple[Shape, ...]:
    """The curves of a fit of `robot` whose parameters are `found`."""
    reach = found[curve.key("reach")]
    shapes = []
    for name in curve.each(robot):
        unit = found[curve.height(curve.varying[0], name)].unit
        none = Estimate(0.0, 0.0, (0.0, 0.0), unit, "fixed")
        every = [found[curve.height(k, name)] if k in curve.varying else none for k in range(len(curve.places))]
        shapes.append(
            Shape(
                name=name,
                variable=curve.variable,
                of=reach.unit,
                unit=unit,
                points=tuple(share * reach.value for share in curve.places),
                values=tuple(e.value for e in every),
                band=tuple((float(e.ci95[0]), float(e.ci95[1])) for e in every),
            )
        )
    return tuple(shapes)
