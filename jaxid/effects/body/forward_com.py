"""A centre of mass ahead of the driven axle, or behind it."""

from dataclasses import dataclass
from typing import ClassVar

from ...robots.effect import Effect
from ..own_parameter import OwnParameter


@dataclass(frozen=True)
class ForwardCentreOfMass(OwnParameter):
    """Frees the robot's own centre of mass along its forward axis: xc of the differential drive."""

    id: ClassVar[str] = "forward_com_offset"
    where: ClassVar[str] = "body"
    same_as: ClassVar[str] = (
        "another mass with the offset of the table: of the mass, what only turns with the wheels, such as rotors behind gears, "
        "has no offset (Mr of a differential drive, which a model file may give)"
    )
    formula: ClassVar[str] = "M (dv/dt - xc w^2) = ..., (J + M xc^2) dw/dt + M xc v w = ..."


LAWS: tuple[Effect, ...] = (ForwardCentreOfMass(),)
