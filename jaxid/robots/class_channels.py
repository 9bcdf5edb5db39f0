"""Channels that are a robot's own, and on its class those of the robot as it comes."""

from collections.abc import Callable
from typing import Any

from ..logs import Channels


class _OnClassToo:
    def __init__(self, plain: Channels, own: Callable[[Any], Channels]):
        self.plain, self.own, self.__doc__ = plain, own, own.__doc__

    def __get__(self, robot: Any, owner: type | None = None) -> Channels:
        return self.plain if robot is None else self.own(robot)


def on_class_too(plain: Channels) -> Callable[[Callable[[Any], Channels]], Any]:
    """A property of a robot; read from the class it is `plain`."""
    return lambda own: _OnClassToo(plain, own)
