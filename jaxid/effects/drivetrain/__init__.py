"""Effects of friction and gears. Speeds are at the wheels' rims [m/s], so that axes of different kinds share them."""

from .asymmetric_friction import AsymmetricFriction
from .asymmetric_viscous_friction import AsymmetricViscousFriction
from .backlash import GearPlay
from .cogging_torque import CoggingTorque
from .coulomb_friction import CoulombFriction
from .load_dependent_friction import LoadDependentFriction
from .stribeck_friction import StribeckFriction, risen
from .viscous_shape import SublinearViscousFriction

__all__ = [
    "AsymmetricFriction",
    "AsymmetricViscousFriction",
    "CoggingTorque",
    "CoulombFriction",
    "GearPlay",
    "LoadDependentFriction",
    "StribeckFriction",
    "SublinearViscousFriction",
    "risen",
]
