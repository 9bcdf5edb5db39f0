"""Effects between the commanded input and the motor's torque."""

from .battery_sag import BatterySag
from .dead_zone import DeadZone
from .freewheeling import FreewheelingDriver
from .input_delay import InputDelay
from .motor_cross_talk import MotorCrossTalk
from .motor_heating import MotorHeating
from .motor_lag import MotorLag
from .motor_strength import MotorGainMismatch
from .saturation import VoltageSaturation

__all__ = [
    "BatterySag",
    "DeadZone",
    "FreewheelingDriver",
    "InputDelay",
    "MotorCrossTalk",
    "MotorGainMismatch",
    "MotorHeating",
    "MotorLag",
    "VoltageSaturation",
]
