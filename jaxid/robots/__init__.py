"""Robots as pure functions of state, input and parameters."""

from .axis import Axis
from .closed_loop import ClosedLoop, Controller, closed_loop
from .custom import Custom
from .differential import DifferentialDrive
from .drive_axis import DriveAxis
from .effect import Effect, EffectError
from .omni import Omni
from .pioneer import Pioneer
from .robot import Robot
from .wheeled import Wheeled
from .wheels import LayoutError, Wheel

BUILT_IN = {robot.name: robot for robot in (Pioneer, Omni, Axis, DifferentialDrive)}
"""The robots that the command line knows by name."""

__all__ = [
    "BUILT_IN",
    "Axis",
    "ClosedLoop",
    "Controller",
    "Custom",
    "DifferentialDrive",
    "DriveAxis",
    "Effect",
    "EffectError",
    "LayoutError",
    "Omni",
    "Pioneer",
    "Robot",
    "Wheel",
    "Wheeled",
    "closed_loop",
]
