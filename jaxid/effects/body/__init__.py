"""Effects on the body as a whole."""

from .coriolis import CoriolisCoupling
from .drag import QuadraticDrag, drag_unit
from .forward_com import ForwardCentreOfMass
from .lateral_com import LateralCentreOfMass
from .payload import FromAMoment
from .slope import GRAVITY, GroundSlope

__all__ = [
    "GRAVITY",
    "CoriolisCoupling",
    "ForwardCentreOfMass",
    "FromAMoment",
    "GroundSlope",
    "LateralCentreOfMass",
    "QuadraticDrag",
    "drag_unit",
]
