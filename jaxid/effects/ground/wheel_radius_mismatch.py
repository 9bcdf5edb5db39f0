"""Wheels of different effective radius (Borenstein and Feng, IEEE Transactions on Robotics and Automation 12, 1996)."""

from dataclasses import dataclass
from typing import ClassVar

from ...robots.effect import Effect
from ..own_parameter import OwnParameter


@dataclass(frozen=True)
class WheelRadiusMismatch(OwnParameter):
    """Frees the robot's `radius_mismatch`: effective radii `R (1 + m)` on one side and `R (1 - m)` on the other."""

    id: ClassVar[str] = "wheel_radius_mismatch"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "R_right = R (1 + radius_mismatch), R_left = R (1 - radius_mismatch)"


LAWS: tuple[Effect, ...] = (WheelRadiusMismatch(),)
