"""Torque that repeats with an angle: cogging, and ripple of the torque itself (Gieras, Permanent Magnet Motor Technology)."""

from dataclasses import dataclass
from typing import ClassVar

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ...robots.trigonometry import sincos
from ..effect_parameters import shape, signed

_FURTHER = (3, 4, 5)
"""Harmonics beyond the second."""


@dataclass(frozen=True)
class CoggingTorque(Effect):
    """Torque ripple `a sin(n phi) + b cos(n phi)` with every driving wheel's angle phi since the start."""

    id: ClassVar[str] = "cogging_torque"
    law: ClassVar[str] = "one_harmonic"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "torque' = torque + sine * sin(periods * phi) + cosine * cos(periods * phi)"
    needs: ClassVar[tuple[str, ...]] = ("drive_axes", "wheel_angles")
    finer: ClassVar[float] = 2.0  # a period may pass within a few of the robot's own steps
    by_torque: ClassVar[bool] = False
    """Whether it is in proportion to the drive torque."""

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        unit, typical = robot.torque_unit, 0.02 * robot.scales.torque
        for angle in robot.angles:
            found |= signed(self, f"sine_{angle}", unit, typical) | signed(self, f"cosine_{angle}", unit, typical)
        return found | shape(self, "periods", f"1/{robot.angle_unit}", 6.0 / robot.scales.angle)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        periods = self.key("periods")
        strengths = {name: robot.parameters[name].typical or 1.0 for name in self.parameters(robot) if name != periods}
        values, looked_at = seen.periods(self.by_torque)
        return tuple(Probe(strengths, {periods: n}, out_of=looked_at) for n in values)

    def ripple(self, angle: str, times: float, state: State, p: Numbers, suffix: str = "") -> Scalar:
        """Sine and cosine of `times` the periods of one wheel."""
        sine, cosine = sincos(times * p[self.key("periods")] * state[angle])
        return p[self.key(f"sine{suffix}_{angle}")] * sine + p[self.key(f"cosine{suffix}_{angle}")] * cosine

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        named = zip(torques, robot.angles, strict=True)
        return tuple(torque + self.ripple(angle, 1.0, state, p) for torque, angle in named)


@dataclass(frozen=True)
class TwoHarmonics(CoggingTorque):
    """With the second harmonic."""

    law: ClassVar[str] = "two_harmonics"
    formula: ClassVar[str] = "torque' = torque + one harmonic of periods * phi + another of 2 * periods * phi"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found, unit, typical = super().parameters(robot), robot.torque_unit, 0.02 * robot.scales.torque
        for angle in robot.angles:
            found |= signed(self, f"sine_2_{angle}", unit, typical) | signed(self, f"cosine_2_{angle}", unit, typical)
        return found

    @property
    def denser(self) -> Effect | None:
        return FiveHarmonics(stands_as=self.stands_as)

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        named = zip(torques, robot.angles, strict=True)
        return tuple(
            t + self.ripple(angle, 1.0, state, p) + self.ripple(angle, 2.0, state, p, "_2") for t, angle in named
        )


@dataclass(frozen=True)
class FiveHarmonics(TwoHarmonics):
    """Any smooth ripple: looked for where two harmonics leave something."""

    law: ClassVar[str] = "five_harmonics"
    first_look: ClassVar[bool] = False
    formula: ClassVar[str] = "torque' = torque + sum over k = 1 to 5 of a harmonic of k * periods * phi"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found, unit, typical = super().parameters(robot), robot.torque_unit, 0.02 * robot.scales.torque
        for angle in robot.angles:
            for k in _FURTHER:
                found |= signed(self, f"sine_{k}_{angle}", unit, typical)
                found |= signed(self, f"cosine_{k}_{angle}", unit, typical)
        return found

    @property
    def denser(self) -> Effect | None:
        return None

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        named = zip(super().torque(torques, state, p, robot), robot.angles, strict=True)
        return tuple(t + sum(self.ripple(angle, float(k), state, p, f"_{k}") for k in _FURTHER) for t, angle in named)


@dataclass(frozen=True)
class RippleOfTheTorque(CoggingTorque):
    """A ripple in proportion to the drive torque itself."""

    law: ClassVar[str] = "share_of_torque"
    by_torque: ClassVar[bool] = True
    formula: ClassVar[str] = "torque' = torque (1 + sine * sin(periods * phi) + cosine * cos(periods * phi))"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for angle in robot.angles:
            found |= signed(self, f"sine_{angle}", "", 0.05) | signed(self, f"cosine_{angle}", "", 0.05)
        return found | shape(self, "periods", f"1/{robot.angle_unit}", 6.0 / robot.scales.angle)

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        named = zip(torques, robot.angles, strict=True)
        return tuple(torque * (1.0 + self.ripple(angle, 1.0, state, p)) for torque, angle in named)


LAWS: tuple[Effect, ...] = (CoggingTorque(), TwoHarmonics(), RippleOfTheTorque(), FiveHarmonics())
