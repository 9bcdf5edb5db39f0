"""A law without a formula: a curve through a few heights, straight between them, of the mechanism's own variable."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ..parameters import Parameter
from ..robots.effect import Effect, Numbers, Scalar
from ..robots.robot import Robot
from .effect_parameters import shape, signed

SHAPE = "shape"
"""The law of a mechanism whose answer is a curve."""


def curve(x: Scalar, knots: Sequence[float], heights: Sequence[Scalar], reach: Scalar) -> Scalar:
    """The curve at `x` >= 0: `heights` at `knots` (increasing shares of `reach`, the first may be 0), straight between them
    and level beyond either end. Linear in the heights, so that a first look and a refit see the same."""
    share = x / reach
    found = heights[0]
    for (left, low), (right, high) in zip(
        zip(knots, heights, strict=True), zip(knots[1:], heights[1:], strict=True), strict=False
    ):
        found = found + (high - low) * jnp.clip((share - left) / (right - left), 0.0, 1.0)
    return found


@dataclass(frozen=True)
class Curve(Effect):
    """A mechanism's curve: heights `at_1`, `at_2` ... at `knots`, shares of the fixed `reach`.

    `free` are the places among the knots whose heights are estimated; the others are zero. `variable` says of what it is a
    curve, for people.
    """

    law: ClassVar[str] = SHAPE
    knots: ClassVar[tuple[float, ...]] = ()
    free: ClassVar[tuple[int, ...]] = ()
    variable: ClassVar[str] = ""

    def heights_and_reach(self, robot: Robot, unit: str, typical: float, of: str, reach: float) -> dict[str, Parameter]:
        """The parameters: heights in `unit` of about `typical`, and the reach in the unit `of`."""
        found: dict[str, Parameter] = {}
        for k in range(len(self.free)):
            found |= signed(self, f"at_{k + 1}", unit, typical)
        return found | shape(self, "reach", of, reach, free=False)

    def at(self, x: Scalar, p: Numbers) -> Scalar:
        """The curve at `x` >= 0."""
        heights: list[Scalar] = [0.0] * len(self.knots)
        for k, place in enumerate(self.free):
            heights[place] = p[self.key(f"at_{k + 1}")]
        return curve(x, self.knots, heights, p[self.key("reach")])
