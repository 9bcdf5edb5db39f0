"""One motor is stronger than the others: torque = Kt i, back-EMF = Ke w, i = (u - back-EMF) / R, of any motor text."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.robot import Robot
from ...robots.traits import refusal
from ..curve import Curve
from ..effect_parameters import signed
from .drives import back_emf, drive_names, each_drive, input_unit, one_torque_each, torque_falls_with_speed


@dataclass(frozen=True)
class OfEach(Effect):
    """A share of every motor, zero for the nominal one. What all share is a change of the robot's constants."""

    id: ClassVar[str] = "motor_gain_mismatch"
    where: ClassVar[str] = "actuator"
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)
    stem: ClassVar[str] = "gain"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for name in drive_names(robot):
            found |= signed(self, f"{self.stem}_{name}", "", 0.05)
        return found

    def may_hold(self, robot: Robot) -> list[str]:
        """The share in the middle of all: what every motor has may be a constant's of the robot."""
        names = self.either_nominal(robot)
        values = {name: robot.parameters[name].value for name in names if robot.parameters[name].free}
        middle = sorted(values, key=lambda name: values[name])[(len(values) - 1) // 2 :][:1]
        return middle if len(values) == len(names) else []

    def either_nominal(self, robot: Robot) -> dict[str, str]:
        return {self.key(f"{self.stem}_{name}"): f"the motor of {name} is nominal" for name in drive_names(robot)}

    def shares_of(self, p: Numbers, robot: Robot) -> list[Scalar]:
        return [p[self.key(f"{self.stem}_{name}")] for name in drive_names(robot)]


@dataclass(frozen=True)
class MotorGainMismatch(OfEach):
    """`u_i' = (1 + gain_i) u_i`: a motor's driver has another gain than nominal."""

    law: ClassVar[str] = "command"
    formula: ClassVar[str] = "u_i' = (1 + gain_i) u_i"
    memoryless: ClassVar[bool] = True

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        return inputs * (1.0 + each_drive(robot, lambda name: p[self.key(f"gain_{name}")]))


@dataclass(frozen=True)
class OfTorque(OfEach):
    """A law that changes what torque a motor makes."""

    needs: ClassVar[tuple[str, ...]] = ("several_drives", "winding")

    def refusal(self, robot: Robot) -> str | None:
        if one_torque_each(robot):
            return None
        return f"{robot.name!r} has not one drive torque for every drive input, so that {self.title} has none to change"


@dataclass(frozen=True)
class TorqueConstant(OfTorque):
    """A motor's torque constant, and by the same physics its back-EMF constant, are (1 + gain_i) times nominal."""

    law: ClassVar[str] = "torque_constant"
    formula: ClassVar[str] = "torque_i = (1 + gain_i) Kt i_i, back-EMF_i = (1 + gain_i) Ke w_i"

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed = list(volts)
        for gain, k in zip(self.shares_of(p, robot), robot.drive_inputs, strict=True):
            changed[k] = volts[k] - gain * back_emf(volts, currents, k, p, robot)
        return tuple(changed)

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        return tuple(t * (1.0 + gain) for t, gain in zip(torques, self.shares_of(p, robot), strict=True))


@dataclass(frozen=True)
class TorqueConstantOfTorques(OfTorque):
    """The same on a robot of which no winding is known, only torques that fall with the speed: what they are without a command
    is what the back-EMF takes."""

    law: ClassVar[str] = "torque_and_back_emf"
    formula: ClassVar[str] = TorqueConstant.formula
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)

    def refusal(self, robot: Robot) -> str | None:
        if refusal(TorqueConstant(), robot) is None:
            return f"the windings of {robot.name!r} are known, so that {self.title} acts on their currents"
        if robot.winding or not torque_falls_with_speed(robot):
            return (
                f"the drive torques of {robot.name!r} do not fall with its speed, so that {self.title} is another gain"
            )
        return super().refusal(robot)

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        braking = robot.drive_torques((0.0,) * len(robot.channels.inputs), state, p)
        shares = zip(torques, braking, self.shares_of(p, robot), strict=True)
        return tuple((1.0 + gain) * (t + gain * b) for t, b, gain in shares)


@dataclass(frozen=True)
class WindingResistance(OfTorque):
    """A motor's winding has (1 + excess_i) times the nominal resistance: less current, less torque, all else equal.

    It needs the torque alone. Where that does not fall with the speed, by a back-EMF, it is another gain of the command.
    """

    law: ClassVar[str] = "winding_resistance"
    formula: ClassVar[str] = "i_i = (u_i - back-EMF_i) / (R (1 + excess_i))"
    stem: ClassVar[str] = "excess"
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)

    def refusal(self, robot: Robot) -> str | None:
        if robot.winding or torque_falls_with_speed(robot):
            return super().refusal(robot)
        return f"the drive torques of {robot.name!r} do not fall with its speed, so that {self.title} is another gain"

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        return tuple(t / (1.0 + excess) for t, excess in zip(torques, self.shares_of(p, robot), strict=True))


_MUCH = 0.3
"""Share of small commands from which what is lost of them is much."""


@dataclass(frozen=True)
class GainCurves(Curve):
    """What each motor gets beyond its command, as a share of it, a curve of the command's size."""

    id: ClassVar[str] = "motor_gain_mismatch"
    where: ClassVar[str] = "actuator"
    formula: ClassVar[str] = "u_i' = u_i (1 + gain_i(|u_i|))"
    memoryless: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)
    knots: ClassVar[tuple[float, ...]] = (0.1, 0.4, 0.9)
    free: ClassVar[tuple[int, ...]] = (0, 1, 2)
    variable: ClassVar[str] = "|u|"
    rather: ClassVar[str] = "actuator_dead_zone"

    def each(self, robot: Robot) -> tuple[str, ...]:
        return tuple(drive_names(robot))

    def agrees(self, robot: Robot) -> bool:
        """Whether a motor that lacks much of small commands lacks it of large ones, too: what loses hardly more of these is
        a dead zone."""
        table = robot.parameters
        size = table[self.key("reach")].value * np.linspace(0.0, 1.0, 41)
        gain = min(
            (np.asarray(self.at(size, table.numbers, name)) for name in self.each(robot)), key=lambda own: own[0]
        )
        lost = -gain * size
        return bool(gain[0] > -_MUCH or lost[-1] > 2.0 * np.max(lost[: len(lost) // 4 + 1]))

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return self.heights_and_reach(robot, "", 0.05, input_unit(robot), robot.scales.input)

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        size, columns = jnp.abs(inputs), [inputs[:, k] for k in range(inputs.shape[1])]
        for name, k in zip(drive_names(robot), robot.drive_inputs, strict=True):
            columns[k] = inputs[:, k] * (1.0 + self.at(size[:, k], p, name))
        return jnp.stack(columns, axis=1)


LAWS: tuple[Effect, ...] = (
    MotorGainMismatch(),
    TorqueConstant(),
    TorqueConstantOfTorques(),
    WindingResistance(),
    GainCurves(),
)
