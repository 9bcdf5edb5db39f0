"""A centre of mass beside the robot's axis of symmetry."""

from dataclasses import dataclass
from typing import ClassVar

from ...robots.effect import Effect
from ..own_parameter import OwnParameter


@dataclass(frozen=True)
class LateralCentreOfMass(OwnParameter):
    """Frees the robot's own lateral centre of mass: xm of the Pioneer, yc (and xc) of the omni."""

    id: ClassVar[str] = "lateral_com_offset"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "centre of mass beside the axis of symmetry"


LAWS: tuple[Effect, ...] = (LateralCentreOfMass(),)
