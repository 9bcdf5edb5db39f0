"""A law without a formula: a smooth curve through a few heights, of the mechanism's own variable."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import product
from typing import ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..parameters import Parameter
from ..robots.effect import Effect, Numbers, Scalar, in_words
from ..robots.probe import Probe, Seen
from ..robots.robot import Robot
from .effect_parameters import shape, signed

SHAPE = "shape"
"""The law of a mechanism whose answer is a curve."""


@lru_cache
def _coefficients(knots: tuple[float, ...]) -> Float[np.ndarray, "K c"]:
    """What every height of a curve adds to its coefficients: the slope at the first knot and, for every piece, by how much its
    square and its cube of the way from the knot where it begins exceed those of the piece before."""
    widths, heights = np.diff(knots), np.eye(len(knots))
    rises = np.diff(heights, axis=1) / widths
    inner = (widths[1:] * rises[:, :-1] + widths[:-1] * rises[:, 1:]) / (widths[:-1] + widths[1:])
    if len(widths) > 1:
        ends = 2.0 * rises[:, 0] - inner[:, 0], 2.0 * rises[:, -1] - inner[:, -1]
        slopes = np.column_stack([ends[0], inner, ends[1]])
    else:
        slopes = np.column_stack([rises, rises])
    left, right = slopes[:, :-1], slopes[:, 1:]
    squares = (3.0 * rises - 2.0 * left - right) / widths
    cubes = (left + right - 2.0 * rises) / widths**2
    more = squares[:, 1:] - squares[:, :-1] - 3.0 * cubes[:, :-1] * widths[:-1]
    return np.column_stack([slopes[:, 0], squares[:, 0], more, cubes[:, 0], np.diff(cubes, axis=1)])


def curve(x: Scalar, knots: Sequence[float], heights: Sequence[Scalar], reach: Scalar) -> Scalar:
    """The curve at `x` >= 0 through `heights` at `knots`, increasing shares of `reach`: cubic between them, with the slopes of
    parabolas through neighbours (exact for a parabola), and level beyond either end.

    Linear in the heights, so that a first look and a refit see the same.
    """
    # One product for all pieces: what JAX traces is then as long for many heights as for few.
    known = not any(isinstance(own, jax.Array) for own in (x, reach, *heights))
    xp = np if known else jnp
    there = [k for k, own in enumerate(heights) if not (isinstance(own, float) and own == 0.0)]
    if not there:
        return xp.zeros(np.shape(x))
    pieces = len(knots) - 1
    h = xp.stack(xp.broadcast_arrays(*(heights[k] for k in there)), axis=-1)
    c = h @ _coefficients(tuple(knots))[there]
    way = xp.clip(x / reach, knots[0], knots[-1]) - knots[0]
    beyond = xp.maximum(way[..., None] - (np.asarray(knots[:-1]) - knots[0]), 0.0)
    bent = (beyond * beyond * (c[..., 1 : 1 + pieces] + beyond * c[..., 1 + pieces :])).sum(axis=-1)
    return heights[0] + c[..., 0] * way + bent


def _farthest(x: Float[np.ndarray, " N"], heights: Float[np.ndarray, " N"]) -> tuple[float, float]:
    """Where a curve that begins at zero is farthest from a straight line to its end, and by how much."""
    off = heights - heights[-1] * x / x[-1]
    at = np.argmax(np.abs(off))
    return float(x[at]), float(off[at])


def rises_early(x: Float[np.ndarray, " N"], heights: Float[np.ndarray, " N"]) -> bool:
    """Whether a curve that begins at zero rises before it is level rather than after: by its farthest point from a straight
    line to its end, since a share of `x` itself may be another thing's."""
    return _farthest(x, heights)[1] >= 0


_AT_ONCE = 1.0 / 3.0
"""Share of the reach within which friction that rises towards standstill has fallen; a cube of the speed is farthest from a
straight line at 0.58 of it."""


def falls_at_once(x: Float[np.ndarray, " N"], heights: Float[np.ndarray, " N"]) -> bool:
    """Whether a curve of the speed that begins at zero falls right after standstill and is level then, but for a straight line:
    friction that rises towards standstill, of which the Coulomb friction took the level."""
    place, off = _farthest(x, heights)
    return off < 0 and place < _AT_ONCE * x[-1]


_WALL = 6.0
"""How many times as far from a straight line a resistance is at the fastest as ever up to three quarters of it where something
stops the motion: 3 for the square of the speed, 4 for its cube, 6 for nearly its fifth power."""


def is_wall(x: Float[np.ndarray, " N"], heights: Float[np.ndarray, " N"]) -> bool:
    """Whether what resists is hardly there up to three quarters of the fastest, but for a straight line, which may be viscous
    friction's, and then stands in the way."""
    early = x <= 0.75 * x[-1]
    off = heights - x * (x[early] @ heights[early]) / (x[early] @ x[early])
    return bool(off[-1] > _WALL * np.max(np.abs(off[early])))


_STEEP = 0.25
"""Share of a curve's range by which neighbouring heights must differ to be a turn of it."""
_TURNS = 4
"""Turns from which a curve goes up and down as no law of one variable does."""


def is_jagged(heights: Float[np.ndarray, " N"], errors: Float[np.ndarray, " N"]) -> bool:
    """Whether a curve goes up and down again and again, by more than the `errors` of its heights (infinite: not known, as where
    they have a factor in common): it takes up what depends on something else."""
    steps, known = np.diff(heights), np.where(np.isfinite(errors), errors, 0.0)
    clear = np.abs(steps) > np.maximum(_STEEP * np.ptp(heights), 3.0 * np.hypot(known[1:], known[:-1]))
    ways = np.sign(steps[clear])
    return bool(np.sum(ways[1:] != ways[:-1]) >= _TURNS)


@dataclass(frozen=True)
class Curve(Effect):
    """A mechanism's curve, or one of each of several things (`each`): heights `at_1`, `at_2` ... at `places`, shares of the
    fixed `reach`.

    A mechanism gives few `knots` and says at which of them (`free`) the heights are estimated; at the others they are zero.
    `between` every two of them stand so many further ones, where few are not enough; `apart` where one curve for all `parts`
    of the robot (its axes) is not, and each has its own. `variable` says of what it is a curve, for people.
    """

    between: int = field(default=0, kw_only=True)
    apart: bool = field(default=False, kw_only=True)

    law: ClassVar[str] = SHAPE
    knots: ClassVar[tuple[float, ...]] = ()
    free: ClassVar[tuple[int, ...]] = ()
    variable: ClassVar[str] = ""
    kinds: ClassVar[tuple[str, ...]] = ("",)
    """Several curves of one thing, such as one for either way."""
    begins_later: ClassVar[bool] = False
    """Whether it is the first height that is held at zero, and not the last, where a share of the variable itself is another
    parameter's: what is limited loses nothing while it is small."""
    settled_by_holding: ClassVar[bool] = False
    """Whether a height is held at zero wherever the data does not tell it, since all heights together, as a sensor's scale, may
    be other parameters'."""
    wanders: ClassVar[bool] = False
    """Whether it may go up and down as often as it likes, as what depends on time or place does."""
    rather: ClassVar[str] = ""
    """The mechanism whose curve it is where it does not agree, if that has another formula."""
    may_as_well: ClassVar[str] = ""
    """The mechanism whose curve makes the same of a robot that makes forces of commands by one factor."""
    reaches: ClassVar[tuple[float, ...]] = (1.0,)
    """Reaches that a first look tries, in units of the usual one: where a curve bends within little of its variable."""

    @property
    def places(self) -> tuple[float, ...]:
        """Where the heights are, as shares of the reach."""
        n = self.between + 1
        inner = [a + (b - a) * i / n for a, b in zip(self.knots, self.knots[1:], strict=False) for i in range(n)]
        return (*inner, self.knots[-1])

    @property
    def varying(self) -> tuple[int, ...]:
        """Those of the places whose heights are estimated."""
        zero = {place * (self.between + 1) for place in range(len(self.knots)) if place not in self.free}
        return tuple(place for place in range(len(self.places)) if place not in zero)

    @property
    def ends(self) -> bool:
        """Whether there is nothing of it at its end and beyond, so that no share of the variable itself is another's."""
        return len(self.places) - 1 not in self.varying

    @property
    def denser(self) -> Self:
        """The same with one more height between every two."""
        return replace(self, between=2 * self.between + 1)

    def may_hold(self, robot: Robot) -> list[str]:
        if len(self.varying) < 2 or self.ends:
            return []
        place, table = self.varying[0 if self.begins_later else -1], robot.parameters
        whole = (name for name in self.each(robot) if all(table[self.height(k, name)].free for k in self.varying))
        return [self.height(place, name) for name in whole]

    def doubt(self, robot: Robot) -> str:
        """What is limited loses of what is large, and never gains."""
        if not self.begins_later:
            return ""
        numbers = robot.parameters.numbers
        most = np.asarray(numbers[self.key("reach")], float)
        end = sum(float(np.asarray(self.at(most, numbers, name))) for name in self.each(robot))
        return "its curve gives more of what is large, where a limit takes of it" if end < 0.0 else ""

    def may_be_none(self, robot: Robot) -> list[tuple[list[str], dict[str, float]]]:
        """Heights of one of its curves that may all be zero, with values of the others' that go with that, for each such curve;
        none where a curve that is nothing says no more than one that is small."""
        return []

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        table, reach = robot.parameters, self.key("reach")
        heights = {name: table[name].typical or 1.0 for name in self.parameters(robot) if table[name].free}
        return tuple(Probe(heights, {reach: times * table[reach].value}) for times in self.reaches)

    def parts(self, robot: Robot) -> tuple[str, ...]:
        """The things that share a curve but may have one each; none where they cannot."""
        return ()

    def of(self, part: str, kind: str = "") -> str:
        """The name of the curve (of a kind) that one of the parts has."""
        return "_".join(word for word in (kind, part if self.apart else "") if word)

    def each(self, robot: Robot) -> tuple[str, ...]:
        """The things that have a curve each, such as motors; one without a name where all share one."""
        parts = self.parts(robot) if self.apart else ("",)
        return tuple(self.of(part, kind) for part in parts for kind in self.kinds)

    def height(self, place: int, name: str = "") -> str:
        """Name of the parameter that is the height at the knot `place` of the curve of `name`."""
        return self.key(f"at_{self.varying.index(place) + 1}" + (f"_{name}" if name else ""))

    def is_height(self, name: str) -> bool:
        """Whether a parameter is one of its heights."""
        return name.startswith(self.key("at_"))

    def heights_and_reach(self, robot: Robot, unit: str, typical: float, of: str, reach: float) -> dict[str, Parameter]:
        """The parameters: heights in `unit` of about `typical`, and the reach in the unit `of`."""
        found: dict[str, Parameter] = {}
        for name in self.each(robot):
            for place in self.varying:
                found |= signed(self, self.height(place, name).removeprefix(self.key("")), unit, typical)
        return found | shape(self, "reach", of, reach, free=False)

    def agrees(self, robot: Robot) -> bool:
        """Whether the curve that `robot` has is this mechanism's, and not another's whose curve has the same formula, or of
        which it is several alike."""
        return True

    def at(self, x: Scalar, p: Numbers, name: str = "") -> Scalar:
        """The curve (of `name`) at `x` >= 0."""
        heights = [p[self.height(k, name)] if k in self.varying else 0.0 for k in range(len(self.places))]
        return curve(x, self.places, heights, p[self.key("reach")])

    def limits(self, robot: Robot, fastest: Callable[[str], float], unit: str) -> str:
        """Why a resistance over a speed in this `unit` is none, where one of its curves is a wall at the `fastest` that logs
        have (of a kind); else empty. What they hardly begin is not judged."""
        numbers, walls = robot.parameters.numbers, []
        least = self.places[1] * numbers[self.key("reach")]
        for kind, part in product(self.kinds, self.parts(robot) if self.apart else ("",)):
            end, name = fastest(kind), self.of(part, kind)
            speeds = np.linspace(0.0, end, 101)
            if end > least and is_wall(speeds, np.asarray(self.at(speeds, numbers, name))):
                walls.append(f"{in_words(name)} is a wall at {end:.3g} {unit}".strip())
        return f"its curve {' and '.join(walls)}, as where a controller or a stop limits the speed" if walls else ""
