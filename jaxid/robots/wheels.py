"""Wheels of a robot in the plane: where they stand, how they roll, and what that leaves of its motion.

In body axes (x ahead, y to the left, from the layout's own origin) the contact point of a wheel at (x, y) moves with

    (V - W y, Vn + W x).

A wheel of radius r that rolls towards the angle alpha turns at the rate at which this has no part along the axis of its
rollers, which is turned by delta from there (0 for omni wheels and for those without rollers, +-45 degrees for mecanum wheels):

    r phi' cos(delta) = (V - W y) cos(alpha + delta) + (Vn + W x) sin(alpha + delta).

A wheel without rollers does not slip sideways, either:

    -(V - W y) sin(alpha) + (Vn + W x) cos(alpha) = 0.

Wheels of a skid-steered robot do slip sideways: all together they only keep the point in their middle from doing so.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
KINDS = ("standard", "skid", "omni", "mecanum")
MOST_LAYOUTS = 256
"""Layouts of which what follows from them is kept."""
_AHEAD = 1e-9
"""Metres to a side by which a wheel is still on the line ahead."""
_SAME = 1e-6
"""Two lines of contact that agree to this many of the layout's lengths are one."""


class LayoutError(ValueError):
    """Wheels that cannot move a robot. The message is one sentence with the remedy."""


@dataclass(frozen=True)
class Wheel:
    """A driven wheel.

    - `name`: its commands are the column `u_<name>`, its speed is `speed_<name>` [rad/s], its angle `angle_<name>` [rad].
    - `at`: x ahead, y to the left [m] of the layout's origin; `rolls`: where positive speed drives it, in degrees to the left
      from ahead.
    - `kind`: "standard" rolls and never slips sideways, "skid" rolls and scrubs sideways when the robot turns, "omni" has
      rollers across, "mecanum" rollers at an angle.
    - `rollers`: of a mecanum wheel, from the rolling direction to the axis of the roller that touches the ground, in degrees to
      the left. By default -45 for wheels ahead left and behind right of the origin and 45 for the others: seen from above,
      the upper rollers point to the robot's middle.
    - `command`: the column of its commands, where several wheels have one.
    """

    name: str
    at: tuple[float, float]
    rolls: float = 0.0
    kind: Literal["standard", "skid", "omni", "mecanum"] = "standard"
    rollers: float | None = None
    command: str = ""

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise LayoutError(f"a wheel is named {self.name!r:.40}; use letters, digits and _, as in front_left")
        if self.kind not in KINDS:
            raise LayoutError(f"wheel {self.name} is of kind {self.kind!r:.40}; use one of {', '.join(KINDS)}")
        if self.rollers is not None and self.kind != "mecanum":
            raise LayoutError(f"wheel {self.name} has `rollers`, but is of kind {self.kind!r}; make it mecanum")
        if not abs(self.tilt) < math.radians(80.0):
            raise LayoutError(
                f"wheel {self.name} has rollers at {self.rollers:g} degrees, along which it drives nothing; give the angle "
                "from its rolling direction to the rollers' axes, such as 45"
            )

    @property
    def input(self) -> str:
        """The column of its commands."""
        return self.command or f"u_{self.name}"

    @property
    def tilt(self) -> float:
        """Angle [rad] of its rollers' axes from the rolling direction."""
        if self.kind != "mecanum":
            return 0.0
        usual = -45.0 if self.at[0] * self.at[1] > 0 else 45.0
        return math.radians(usual if self.rollers is None else self.rollers)

    @property
    def side(self) -> float:
        """1 on the right of the origin, -1 on the left, 0 on the line ahead."""
        return float(np.sign(-self.at[1])) if abs(self.at[1]) > _AHEAD else 0.0

    @property
    def forward(self) -> float:
        """Angle [rad] of its rolling direction from ahead."""
        return math.radians(self.rolls)


def rolling(wheel: Wheel) -> tuple[float, float, float]:
    """Rim speed per V, Vn and W."""
    angle, (x, y) = wheel.forward + wheel.tilt, wheel.at
    row = math.cos(angle), math.sin(angle), x * math.sin(angle) - y * math.cos(angle)
    return tuple(_round(number / math.cos(wheel.tilt)) for number in row)  # type: ignore[return-value]


def _held_sideways(wheels: Iterable[Wheel]) -> list[tuple[float, float, float]]:
    """Combinations of V, Vn and W that the wheels keep at zero."""
    wheels = tuple(wheels)
    found = [(w.forward, *w.at) for w in wheels if w.kind == "standard"]
    skid = [w for w in wheels if w.kind == "skid"]
    if skid:
        middle = np.mean([w.at for w in skid], axis=0)
        found.append((skid[0].forward, *middle))
    return [(-math.sin(a), math.cos(a), x * math.cos(a) + y * math.sin(a)) for a, x, y in found]


@lru_cache(MOST_LAYOUTS)
def twists(wheels: tuple[Wheel, ...]) -> tuple[tuple[float, float, float], ...]:
    """The motions (V, Vn, W) that the wheels allow, one per velocity of the robot: along, sideways and turning where nothing
    holds them, else along where they roll and turning.

    Raises `LayoutError` for wheels that let it only drive straight on, or only turn about a point, or not move, and for
    wheels that leave one of its motions undriven.
    """
    held = _held_sideways(wheels)
    if not held:
        found = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    else:
        lengths = max(max(abs(c) for c in wheel.at) for wheel in wheels) or 1.0
        scaled = np.array(held) / (1.0, 1.0, lengths)
        if np.linalg.matrix_rank(scaled, tol=_SAME * len(held)) > 1:
            raise LayoutError(
                "wheels of kind standard on several lines let the robot only drive straight on, or turn about one point; make "
                "those that scrub when it turns kind = 'skid', and leave casters out"
            )
        sine, cosine, arm = -held[0][0], held[0][1], held[0][2]
        if cosine < -_SAME or (abs(cosine) <= _SAME and sine < 0):
            sine, cosine, arm = -sine, -cosine, -arm
        found = [(cosine, sine, 0.0), (sine * arm, -cosine * arm, 1.0)]
    chosen = tuple(tuple(_round(number) for number in row) for row in found)
    driven = np.array([rolling(wheel) for wheel in wheels]) @ np.array(chosen).T
    if np.linalg.matrix_rank(driven, tol=1e-9 * max(1.0, float(np.abs(driven).max()))) < len(chosen):
        raise LayoutError(
            "no wheel drives or holds some motion of the robot (sideways, or turning); check where the wheels are (at) and "
            "where they roll (rolls), and their kinds"
        )
    return chosen  # type: ignore[return-value]


@lru_cache(MOST_LAYOUTS)
def rim_rows(wheels: tuple[Wheel, ...]) -> tuple[tuple[float, ...], ...]:
    """A: rim speeds of the wheels per velocity; what rounding leaves beside zero is zero."""
    rows = np.array([rolling(wheel) for wheel in wheels]) @ np.array(twists(wheels)).T
    rows[np.abs(rows) < 1e-12 * np.abs(rows).max(axis=0)] = 0.0
    return tuple(map(tuple, rows.tolist()))


def _round(number: float) -> float:
    """Without what sines of right angles leave beside zero and one."""
    near = round(number)
    return float(near) if abs(number - near) < 1e-15 * max(1.0, abs(number)) else number
