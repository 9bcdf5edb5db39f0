"""A user's own effect, which jaxid's catalogue lacks: the driving wheels' dry friction differs."""

from dataclasses import dataclass
from typing import ClassVar

from jaxid import Effect, Parameter, Robot


@dataclass(frozen=True)
class UnevenFriction(Effect):
    """`difference` [N m]: how much more dry friction the Pioneer's right wheel has than its left; Cs is their mean."""

    id: ClassVar[str] = "uneven_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C_right = C + difference / 2, C_left = C - difference / 2"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return {self.key("difference"): Parameter(0.0, "N m", free=True, typical=0.05, source="user")}

    def dry(self, levels, speeds, state, p):
        half = 0.5 * p[self.key("difference")]
        (right_back, right_ahead), (left_back, left_ahead), *rest = levels
        right, left = (right_back + half, right_ahead + half), (left_back - half, left_ahead - half)
        return (right, left, *rest)
