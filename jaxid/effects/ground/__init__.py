"""Effects between the wheels and the floor."""

from .effective_track import EffectiveTrack
from .sideways_friction import SidewaysFriction
from .surface_change import SurfaceChange
from .traction_limit import TractionLimit
from .turning_friction import TurningFriction
from .wheel_radius_mismatch import WheelRadiusMismatch

__all__ = [
    "EffectiveTrack",
    "SidewaysFriction",
    "SurfaceChange",
    "TractionLimit",
    "TurningFriction",
    "WheelRadiusMismatch",
]
