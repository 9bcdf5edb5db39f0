"""A track width other than drawn: where wide wheels touch, or skid (Borenstein and Feng, 1996; Mandow et al., 2007)."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, State
from ...robots.robot import Robot
from ..curve import Curve
from ..effect_parameters import signed, still
from ..own_parameter import OwnParameter

_STILL = 0.1
"""Share of the largest yaw rate within which one way of turning becomes the other."""


@dataclass(frozen=True)
class EffectiveTrack(OwnParameter):
    """Frees the robot's own width between the wheels."""

    id: ClassVar[str] = "effective_track"
    law: ClassVar[str] = "constant"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "the width between the wheels is another than the table's"


class _ByYawRate(Effect):
    """A width that changes with how the robot turns."""

    needs: ClassVar[tuple[str, ...]] = ("mechanism",)

    def refusal(self, robot: Robot) -> str | None:
        return (
            None if robot.turning in robot.velocities else f"{robot.name!r} does not say which velocity is its yaw rate"
        )

    def _share(self, rate: Scalar, p: Numbers, robot: Robot) -> Scalar:
        """By which share the width is larger at a yaw rate."""
        raise NotImplementedError

    def numbers(self, p: Numbers, state: State, robot: Robot) -> Numbers:
        larger = 1.0 + self._share(state[robot.turning], p, robot)
        return {**p, **{name: p[name] * larger for name in robot.mechanisms[self.id]}}


@dataclass(frozen=True)
class TrackByDirection(_ByYawRate):
    """Wider in turns one way than the other."""

    id: ClassVar[str] = "effective_track"
    law: ClassVar[str] = "by_direction"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "width' = width * (1 + share * sgn(yaw rate))"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        reversing = _STILL * robot.scales.output(robot.turning)
        return signed(self, "share", "", 0.05) | still(self, robot.velocity_unit(robot.turning), reversing)

    def _share(self, rate: Scalar, p: Numbers, robot: Robot) -> Scalar:
        return p[self.key("share")] * jnp.tanh(rate / p[self.key("still")])


@dataclass(frozen=True)
class TrackCurve(Curve, _ByYawRate):
    """The width, a curve of the yaw rate."""

    id: ClassVar[str] = "effective_track"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "width' = width * (1 + share(|yaw rate|))"
    needs: ClassVar[tuple[str, ...]] = ("mechanism",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.25, 0.5, 1.0)
    free: ClassVar[tuple[int, ...]] = (0, 1, 2, 3)
    variable: ClassVar[str] = "|yaw rate|"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        of, rate = robot.velocity_unit(robot.turning), robot.scales.reach(robot.turning)
        return self.heights_and_reach(robot, "", 0.05, of, rate)

    def _share(self, rate: Scalar, p: Numbers, robot: Robot) -> Scalar:
        return self.at(jnp.abs(rate), p)


LAWS: tuple[Effect, ...] = (EffectiveTrack(), TrackByDirection(), TrackCurve())
