"""Wheels of different effective radius (Borenstein and Feng, IEEE Transactions on Robotics and Automation 12, 1996)."""

from dataclasses import dataclass
from typing import ClassVar

from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.robot import Robot
from ..actuator.drives import back_emf
from ..actuator.motor_strength import OfTorque
from ..own_parameter import OwnParameter


@dataclass(frozen=True)
class WheelRadiusMismatch(OwnParameter):
    """Frees the robot's `radius_mismatch`: effective radii `R (1 + m)` on one side and `R (1 - m)` on the other."""

    id: ClassVar[str] = "wheel_radius_mismatch"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "R_right = R (1 + radius_mismatch), R_left = R (1 - radius_mismatch)"

    def conventions(self, robot: Robot) -> dict[str, dict[str, float]]:
        """Either wheel alone may be the one that is off: their mean is then another, which no parameter that is free says."""
        radius = robot.wheel_radius
        if len(self.frees(robot)) != 1 or (radius in robot.parameters and robot.parameters[radius].free):
            return {}
        mismatch, numbers = robot.parameters[self.frees(robot)[0]].value, robot.parameters.numbers
        own = zip(robot.wheel_sides, (-mismatch / (1.0 + mismatch), mismatch / (1.0 - mismatch)), strict=True)
        found = {f"the {side} is as the table says": robot.with_larger_wheels(numbers, mean) for side, mean in own}
        return {words: values for words, values in found.items() if values}


@dataclass(frozen=True)
class WithTheirMean(WheelRadiusMismatch):
    """The same where their mean is not what the table says either, as where one wheel is worn and the other as it was."""

    law: ClassVar[str] = "with_their_mean"
    formula: ClassVar[str] = (
        "R_right = R (1 + radius_mismatch), R_left = R (1 - radius_mismatch), R another than the table's"
    )

    def refusal(self, robot: Robot) -> str | None:
        if robot.wheel_radius in robot.parameters:
            return None
        return f"{robot.name!r} has no parameter that is its wheels' radius, whose mean {self.title} frees"

    def frees(self, robot: Robot) -> tuple[str, ...]:
        return (*super().frees(robot), robot.wheel_radius)


@dataclass(frozen=True)
class RadiusOfEachWheel(WheelRadiusMismatch):
    """Every wheel with a radius of its own, of robots that have such parameters: one worn or replaced, or four of a batch."""

    law: ClassVar[str] = "each_radius"
    formula: ClassVar[str] = "R_i = R (1 + mismatch_i)"

    def refusal(self, robot: Robot) -> str | None:
        return (
            None if robot.wheel_radii else f"{robot.name!r} has no parameters of its own for the radius of every wheel"
        )

    def frees(self, robot: Robot) -> tuple[str, ...]:
        return robot.wheel_radii


@dataclass(frozen=True)
class RadiusOfEach(OfTorque):
    """Every driving wheel of three or more with a radius of its own: less force of the same torque, and fewer turns of the same
    way, so that its motor's back-EMF is smaller, too. No log of the body's motion tells it from another torque constant; one of
    the wheels' turning does, so that a robot that measures more than its body's motion cannot have this law."""

    id: ClassVar[str] = "wheel_radius_mismatch"
    law: ClassVar[str] = "each_wheel"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "R_i = R (1 + mismatch_i)"
    stem: ClassVar[str] = "mismatch"
    needs: ClassVar[tuple[str, ...]] = (*OfTorque.needs, "mechanism")

    def refusal(self, robot: Robot) -> str | None:
        if len(robot.drive_inputs) < 3:
            return f"{robot.name!r} drives two wheels or fewer, of which the usual law of {self.id} is"
        channels = robot.channels
        others = [name for name in channels.outputs if name not in robot.states]
        others += [name for name in channels.measured if name in robot.angles]
        if others:
            return (
                f"{', '.join(others)} of {robot.name!r} may show how fast its wheels turn, which another radius changes: only "
                "its own parameters for that (`mechanisms=`) can tell by how much"
            )
        if robot.wheel_radii or len(robot.mechanisms.get(self.id, ())) > 1:
            return f"{robot.name!r} has parameters of its own for {self.id}, wheel by wheel"
        return super().refusal(robot)

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed = list(volts)
        for larger, k in zip(self.shares_of(p, robot), robot.drive_inputs, strict=True):
            changed[k] = volts[k] + larger / (1.0 + larger) * back_emf(volts, currents, k, p, robot)
        return tuple(changed)

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        return tuple(t / (1.0 + larger) for t, larger in zip(torques, self.shares_of(p, robot), strict=True))


LAWS: tuple[Effect, ...] = (WheelRadiusMismatch(), WithTheirMean(), RadiusOfEachWheel(), RadiusOfEach())
