"""What may differ between two sets of logs and is no mechanism of the catalogue: every model has it, by its nominal amount.

A battery that gives more, a floor on which everything rubs more, one wheel whose bearing is worn: shares of what the robot
says of itself, zero where nothing changed.
"""

from dataclasses import dataclass
from typing import ClassVar

from ...effects.actuator.drives import each_drive
from ...effects.effect_parameters import share
from ...parameters import Parameter
from ...robots.effect import Effect, Levels, Numbers, Scalars, State
from ...robots.robot import Robot


@dataclass(frozen=True)
class CommandGain(Effect):
    """Everything that is commanded of the drives arrives larger by a share: another battery behind the same duty cycle,
    another gain of the driver."""

    id: ClassVar[str] = "command_gain"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u' = (1 + gain) u"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return share(self, "gain")

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return inputs * (1.0 + each_drive(robot, lambda name: p[self.key("gain")]))


@dataclass(frozen=True)
class DryShare(Effect):
    """The Coulomb friction of the rubbing `axes` is larger by a share."""

    axes: tuple[int, ...] = ()

    id: ClassVar[str] = "dry_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = (1 + coulomb) C"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return share(self, "coulomb")

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        factor = 1.0 + p[self.key("coulomb")]
        return tuple((b * factor, f * factor) if i in self.axes else (b, f) for i, (b, f) in enumerate(levels))


@dataclass(frozen=True)
class ViscousShare(Effect):
    """The viscous friction of the rubbing `axes` is larger by a share."""

    axes: tuple[int, ...] = ()

    id: ClassVar[str] = "viscous_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "B' = (1 + viscous) B"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return share(self, "viscous")

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        factor = 1.0 + p[self.key("viscous")]
        return tuple(r * factor if i in self.axes else r for i, r in enumerate(resistance))


@dataclass(frozen=True)
class TorqueShare(Effect):
    """The drive torque `of` one drive is larger by a share, and what its back-EMF takes of it as well: a gear that loses less,
    a winding of less resistance."""

    of: int = 0

    id: ClassVar[str] = "drive_torque"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "torque' = (1 + torque) torque"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return share(self, "torque")

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        factor = 1.0 + p[self.key("torque")]
        return tuple(t * factor if i == self.of else t for i, t in enumerate(torques))
