"""Effects between the motion and what the log says of it."""

from .bias import SensorBias
from .cross_talk import SensorCrossTalk
from .delay import SensorDelay
from .lag import SensorLag
from .scale import SensorScale

__all__ = ["SensorBias", "SensorCrossTalk", "SensorDelay", "SensorLag", "SensorScale"]
