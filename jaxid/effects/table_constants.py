"""Constants of the robot's table that are not what the table says."""

from dataclasses import dataclass
from typing import ClassVar

from ..robots.effect import Effect
from ..robots.robot import Robot


@dataclass(frozen=True)
class TableConstants(Effect):
    """Frees `constants`, parameters of the robot that its table takes as known: what is missing is their right values.

    No candidate of the catalogue: any robot has any number of them. A model with it is a model whose table is right.
    """

    id: ClassVar[str] = "table_constants"
    where: ClassVar[str] = "table"
    formula: ClassVar[str] = "constants of the robot's table have other values"

    constants: tuple[str, ...] = ()

    def frees(self, robot: Robot) -> tuple[str, ...]:
        return self.constants
