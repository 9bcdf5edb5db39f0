"""Mechanisms that are parameters of the robot itself."""

from dataclasses import dataclass
from typing import ClassVar

from ..robots.effect import Effect
from ..robots.robot import Robot


@dataclass(frozen=True)
class OwnParameter(Effect):
    """Frees the robot's own parameters that are this mechanism."""

    needs: ClassVar[tuple[str, ...]] = ("mechanism",)

    def frees(self, robot: Robot) -> tuple[str, ...]:
        return robot.mechanisms.get(self.id, ())

    def there_already(self, robot: Robot) -> bool:
        return all(robot.parameters[name].free for name in self.frees(robot))
