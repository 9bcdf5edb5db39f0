"""The robot whose logs hold the angles of its wheels in the place of speeds."""

from collections.abc import Iterable
from dataclasses import fields, replace
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from .robot import Robot

R = TypeVar("R", bound="Robot")


def measuring_angles(robot: R) -> R:
    """The robot with `wheel_angles=True`, where it has that field and angles that are no channels yet; else as it is."""
    if robot.wheel_angles or not robot.angles or all(own.name != "wheel_angles" for own in fields(robot)):
        return robot
    measuring = replace(robot, wheel_angles=True)
    return measuring if measuring.measured_angles else robot


def with_angles_of(robot: R, columns: Iterable[str]) -> R:
    """The robot that measures its wheels' angles, where these are among the columns and not all its outputs are."""
    there, measuring = set(columns), measuring_angles(robot)
    angles = measuring is not robot and set(measuring.measured_angles) <= there
    return measuring if angles and not set(robot.channels.outputs) <= there else robot
