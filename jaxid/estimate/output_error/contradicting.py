"""What columns of the logs say against one another, by what is known of the robot: no fit makes it right."""

from ...logs import LogSet
from ...robots.robot import Robot
from .braking_motors import braking_motors
from .wheels_beside_body import wheels_beside_body


def contradicting(robot: Robot, logs: LogSet) -> tuple[str, ...]:
    """Sentences on commands and angles that cannot be what they are taken for; none where nothing contradicts."""
    return tuple(filter(None, (braking_motors(robot, logs), wheels_beside_body(robot, logs))))
