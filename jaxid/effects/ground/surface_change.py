"""Friction that depends on the place: a carpet, a wet spot, joints of tiles."""

from dataclasses import dataclass, replace
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.effect import Effect, Levels, Numbers, Scalar, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ...robots.trigonometry import sincos
from ..curve import curve
from ..effect_parameters import shape, signed
from ..in_some_logs import InSomeLogs
from ..line import beyond_line, line_parameters, lines_across
from .along_the_way import LAWS as ALONG_THE_WAY

_SIZE = 0.3
"""Relative change of friction that is tried."""
_ALONG = (-1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0)
"""Places of a profile along its direction, in shares of its reach to either side of the line."""
_OUTWARDS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)
"""Those of one by the way from a centre, in radii."""


@dataclass(frozen=True)
class SurfaceChange(Effect):
    """Friction of the drivetrain scaled beyond a line on the floor, `x cos(angle) + y sin(angle) > offset`.

    The edge is smooth over the fixed `width`, the way of one integration step. While it is searched for it is `edge` times
    as wide, so that a line in the wrong place still tells where the right one is.
    """

    edge: float = 1.0

    id: ClassVar[str] = "surface_change"
    law: ClassVar[str] = "line"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "beyond the line: C' = C (1 + coulomb), B' = B (1 + viscous)"
    needs: ClassVar[tuple[str, ...]] = ("pose", "drive_axes")
    tried: ClassVar[tuple[float, ...]] = (0.3, 0.5, 0.7, 0.85)
    """Lines that are tried along each direction, by the share of the path that lies on their near side."""

    @property
    def blurred(self) -> "SurfaceChange":
        return replace(self, edge=4.0)

    @property
    def sharp(self) -> "SurfaceChange":
        return replace(self, edge=1.0)

    def _strengths(self) -> dict[str, Parameter]:
        return signed(self, "coulomb", "", _SIZE) | signed(self, "viscous", "", _SIZE)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return self._strengths() | line_parameters(self, robot)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        """Lines across the floor that part of the driven path lies beyond."""
        return self._at(lines_across(self, seen, self.tried))

    def _at(self, places: list[dict[str, float]]) -> tuple[Probe, ...]:
        strengths = {self.key("coulomb"): _SIZE, self.key("viscous"): _SIZE}
        return tuple(Probe(strengths, place, out_of=len(places)) for place in places)

    def _beyond(self, state: State, p: Numbers) -> Scalar:
        return beyond_line(self, state, p, self.edge)

    def sides_exchanged(self, robot: Robot, x: float, y: float) -> dict[str, float]:
        if self.law not in (SurfaceChange.law, GradualChange.law):
            return {}
        coulomb, viscous, angle, offset = (
            robot.parameters[self.key(name)].value for name in ("coulomb", "viscous", "angle", "offset")
        )
        if not (x * np.cos(angle) + y * np.sin(angle) > offset and min(coulomb, viscous) > -1.0):
            return {}
        turned = float((angle + np.pi) % (2.0 * np.pi))
        shares = {name: 1.0 / (1.0 + share) - 1.0 for name, share in (("coulomb", coulomb), ("viscous", viscous))}
        return {self.key(name): value for name, value in ({**shares, "angle": turned, "offset": -offset}).items()}

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        factor, changed = 1.0 + p[self.key("coulomb")] * self._beyond(state, p), list(levels)
        for axis in robot.drive_axes:
            changed[axis] = (levels[axis][0] * factor, levels[axis][1] * factor)
        return tuple(changed)

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        factor, changed = 1.0 + p[self.key("viscous")] * self._beyond(state, p), list(resistance)
        for axis in robot.drive_axes:
            changed[axis] = resistance[axis] * factor
        return tuple(changed)


@dataclass(frozen=True)
class GradualChange(SurfaceChange):
    """The same with a width that is estimated: friction that changes gradually along one direction."""

    law: ClassVar[str] = "gradual"
    formula: ClassVar[str] = "C' = C (1 + coulomb h), B' = B (1 + viscous h), h from 0 to 1 across the line over width"
    tried: ClassVar[tuple[float, ...]] = (0.5,)

    @property
    def blurred(self) -> "GradualChange":
        return self

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        sharp = super().parameters(robot)[self.key("width")].value
        wide = shape(self, "width", robot.length_unit, 0.25 * robot.scales.length)
        # A width of none divides by zero; a robot that drives far within one sample has an edge wider than that at first.
        bounded = {name: replace(p, value=max(p.value, sharp), lower=sharp) for name, p in wide.items()}
        return super().parameters(robot) | bounded

    @property
    def denser(self) -> Effect | None:
        return Profile(self.edge, stands_as=self.stands_as)


@dataclass(frozen=True)
class Profile(GradualChange):
    """Any friction along one direction: a gradual change and a smooth curve besides, looked for where the change alone leaves
    something."""

    law: ClassVar[str] = "profile"
    formula: ClassVar[str] = (
        "C' = C (1 + coulomb h), B' = B (1 + viscous h), h = gradual + a curve of the way across, zero at the line"
    )
    first_look: ClassVar[bool] = False

    @property
    def denser(self) -> Effect | None:
        return None

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found = super().parameters(robot)
        for k, place in enumerate(_ALONG):
            found |= signed(self, f"at_{k}", "", _SIZE) if place else {}
        return found | shape(self, "reach", robot.length_unit, robot.scales.length, free=False)

    def _beyond(self, state: State, p: Numbers) -> Scalar:
        sine, cosine = sincos(p[self.key("angle")])
        way = state["x"] * cosine + state["y"] * sine - p[self.key("offset")]
        heights = [p[self.key(f"at_{k}")] if place else 0.0 for k, place in enumerate(_ALONG)]
        return super()._beyond(state, p) + curve(way, _ALONG, heights, p[self.key("reach")])


@dataclass(frozen=True)
class Disc(SurfaceChange):
    """Another friction within a disc."""

    law: ClassVar[str] = "disc"
    formula: ClassVar[str] = "within the disc: C' = C (1 + coulomb), B' = B (1 + viscous)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.15 * robot.scales.length
        place = (
            signed(self, "x", robot.length_unit, typical)
            | signed(self, "y", robot.length_unit, typical)
            | shape(self, "radius", robot.length_unit, typical)
        )
        width = shape(self, "width", robot.length_unit, 0.25 * robot.scales.speed * robot.scales.interval, free=False)
        return self._strengths() | place | width

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        path = seen.path()
        if path is None:
            return ()
        size = float(np.max(np.ptp(path, axis=0)))
        centres = [
            (x, y) for x in np.quantile(path[:, 0], [0.1, 0.5, 0.9]) for y in np.quantile(path[:, 1], [0.1, 0.5, 0.9])
        ]
        return self._at(
            [
                {self.key("x"): float(x), self.key("y"): float(y), self.key("radius"): share * size}
                for x, y in centres
                for share in (0.1, 0.2)
            ]
        )

    @property
    def denser(self) -> Effect | None:
        return SoftDisc(self.edge, stands_as=self.stands_as)

    def _edge(self, p: Numbers) -> Scalar:
        return self.edge * p[self.key("width")]

    def _off_the_centre(self, state: State, p: Numbers) -> tuple[Scalar, Scalar]:
        return state["x"] - p[self.key("x")], state["y"] - p[self.key("y")]

    def _beyond(self, state: State, p: Numbers) -> Scalar:
        (x, y), radius = self._off_the_centre(state, p), p[self.key("radius")]
        # Of the squares, over twice the radius: smooth at the centre, and the distance near the edge.
        inside = 0.5 * (radius * radius - x * x - y * y) / radius
        return 0.5 * (1.0 + jnp.tanh(inside / self._edge(p)))


@dataclass(frozen=True)
class SoftDisc(Disc):
    """A disc whose edge is as wide as a share of its radius: looked for where a sharp one leaves something."""

    law: ClassVar[str] = "soft_disc"
    formula: ClassVar[str] = (
        "C' = C (1 + coulomb h), B' = B (1 + viscous h), h from 1 to 0 across the edge over softness * radius"
    )
    first_look: ClassVar[bool] = False

    @property
    def denser(self) -> Effect | None:
        return DiscProfile(self.edge, stands_as=self.stands_as)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        soft = Parameter(0.3, "", free=True, lower=0.0, typical=0.3, source="catalogue")
        return super().parameters(robot) | {self.key("softness"): soft}

    def _edge(self, p: Numbers) -> Scalar:
        return super()._edge(p) + p[self.key("softness")] * p[self.key("radius")]


@dataclass(frozen=True)
class DiscProfile(SoftDisc):
    """Any friction by the way from a centre."""

    law: ClassVar[str] = "disc_profile"
    formula: ClassVar[str] = (
        "C' = C (1 + coulomb h), B' = B (1 + viscous h), h = soft disc + a curve of the way from its centre"
    )

    @property
    def denser(self) -> Effect | None:
        return None

    def _heights(self) -> list[str | None]:
        """Names of the heights at all places; none at the edge, which the radius moves, and at the end."""
        return [
            self.key(f"at_{k}") if place != 1.0 and place < _OUTWARDS[-1] else None for k, place in enumerate(_OUTWARDS)
        ]

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found = super().parameters(robot)
        for name in filter(None, self._heights()):
            found |= signed(self, name.removeprefix(self.key("")), "", _SIZE)
        return found

    def _beyond(self, state: State, p: Numbers) -> Scalar:
        (x, y), radius = self._off_the_centre(state, p), p[self.key("radius")]
        way = jnp.sqrt(x * x + y * y + (0.1 * radius) ** 2)  # smooth at the centre
        heights = [0.0 if name is None else p[name] for name in self._heights()]
        return super()._beyond(state, p) + curve(way, _OUTWARDS, heights, radius)


@dataclass(frozen=True)
class OtherFloor(InSomeLogs):
    """Another friction of the drivetrain throughout the logs whose column `other_floor` is 1."""

    id: ClassVar[str] = "surface_change"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "C' = C (1 + coulomb), B' = B (1 + viscous) where the log's other_floor is 1"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes",)
    from_columns: ClassVar[tuple[str, ...]] = ("other_floor",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return signed(self, "coulomb", "", _SIZE) | signed(self, "viscous", "", _SIZE)

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        factor, changed = jnp.maximum(1.0 + p[self.key("coulomb")] * self.here(state), 0.0), list(levels)
        for axis in robot.drive_axes:
            changed[axis] = (levels[axis][0] * factor, levels[axis][1] * factor)
        return tuple(changed)

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        factor, changed = 1.0 + p[self.key("viscous")] * self.here(state), list(resistance)
        for axis in robot.drive_axes:
            changed[axis] = resistance[axis] * factor
        return tuple(changed)


LAWS: tuple[Effect, ...] = (
    SurfaceChange(),
    GradualChange(),
    Profile(),
    Disc(),
    SoftDisc(),
    DiscProfile(),
    *ALONG_THE_WAY,
    OtherFloor(),
)
