"""Mechanisms that are parameters of the robot itself."""

from dataclasses import dataclass
from typing import ClassVar

from ..robots.effect import Effect
from ..robots.probe import Probe, Seen
from ..robots.robot import Robot

_STEP = 0.05
"""Share of its value by which a known constant is moved in a first look."""


@dataclass(frozen=True)
class OwnParameter(Effect):
    """Frees the robot's own parameters that are this mechanism."""

    needs: ClassVar[tuple[str, ...]] = ("mechanism",)

    def frees(self, robot: Robot) -> tuple[str, ...]:
        return robot.mechanisms.get(self.id, ())

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        table = [(name, robot.parameters[name]) for name in self.frees(robot) if robot.parameters[name].free]
        # A constant that is something is moved by a little; one that is nothing has a size to expect.
        moved = {name: p.value + (_STEP * abs(p.value) or p.typical or 1.0) for name, p in table}
        return (Probe(moved),) if moved else ()

    def there_already(self, robot: Robot) -> bool:
        return all(robot.parameters[name].free for name in self.frees(robot))
