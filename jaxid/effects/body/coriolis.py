"""The turning frame's own terms."""

from dataclasses import dataclass
from typing import ClassVar

from ...robots.effect import Effect
from ...robots.robot import Robot
from ..own_parameter import OwnParameter


@dataclass(frozen=True)
class CoriolisCoupling(OwnParameter):
    """Frees the share of the turning frame's own terms, which the omni paper's equations lack (0) and nature has (1)."""

    id: ClassVar[str] = "coriolis_coupling"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "M (dV/dt - c W Vn) = ..., M (dVn/dt + c W V) = ..."

    def there_already(self, robot: Robot) -> bool:
        return any(robot.parameters[name].value != 0.0 for name in self.frees(robot))


LAWS: tuple[Effect, ...] = (CoriolisCoupling(),)
