"""Dry friction in rollouts: truly sticking (default) or smoothed.

A smoothed `sgn` wide enough to be cheap leaves an error that looks like a missing effect. The implicit law does not:
before each step it finds the friction torques that would bring every rubbing speed to rest by the end of the step, each
limited by its Coulomb level, and holds them through the step. An axis whose torque is not limited sticks; one at its
limit slides. An axis that slides through zero within the step rubs one way before and the other way after: its limit is
the mean of the two levels over the step, so that the speed is right to second order in the step. Forward-mode
differentiation goes straight through the limits.
"""

from dataclasses import dataclass

import jax.numpy as jnp

from ..robots.effect import Numbers, Scalars, State
from ..robots.robot import Robot
from ..robots.signal_path import numbers

_TINY = 1e-30


def _mean_limits(start, pull, backward, forward, compliance, h):
    """Least and largest mean friction torque over a step for an axis that starts at speed `start`.

    `pull` is its acceleration without its own friction. Sliding backwards at first, friction pushes with `backward`
    until the axis comes to rest, a share `turned` of the step later, and then resists with `forward`; and likewise the
    other way round.
    """
    range_ = forward + backward
    turned = jnp.clip(-start / (h * jnp.maximum(pull + compliance * backward, _TINY)), 0.0, 1.0)
    most = forward - range_ * turned
    turned = jnp.clip(start / (h * jnp.maximum(compliance * forward - pull, _TINY)), 0.0, 1.0)
    least = -backward + range_ * turned
    return least, most


@dataclass(frozen=True)
class Sticking:
    """True sticking by an implicit step; `sweeps` of projected Gauss-Seidel solve for the axes' torques together.

    A single axis, or axes that do not push one another, stand still to rounding. Where they are coupled, rest is as
    exact as the sweeps: two leave the Pioneer creeping below 1e-5 m/s, and each further one cuts that about a
    hundredfold.
    """

    sweeps: int = 2

    def held(self, robot: Robot, state: State, inputs: Scalars, h, p: Numbers) -> Scalars:
        """Friction torques to hold over a step of `h` seconds."""
        speeds = robot.rubbing(state, p)
        if not speeds:
            return ()
        axes = range(len(speeds))
        levels = robot.coulomb(state, p)
        free = robot.rates(state, inputs, (0.0,) * len(speeds), p)
        moved = robot.rubbing_rates(state, free, p)
        slip = [speeds[i] + h * moved[i] for i in axes]  # rubbing speeds at the end of the step, friction apart
        compliance = robot.compliance(state, numbers(robot, state, p))
        torques = [0.0 * s for s in slip]
        for _ in range(self.sweeps if len(speeds) > 1 else 1):
            for i in axes:
                backward, forward = levels[i]
                own = compliance[i][i]
                end = slip[i] + h * own * torques[i]  # where the axis would end up without its own friction
                least, most = _mean_limits(speeds[i], (end - speeds[i]) / h, backward, forward, own, h)
                change = jnp.clip(end / (h * own), least, most) - torques[i]
                torques[i] = torques[i] + change
                slip = [slip[j] - h * compliance[j][i] * change for j in axes]
        return tuple(torques)

    def present(self, robot: Robot, state: State, held: Scalars, p: Numbers) -> Scalars:
        """Friction torques inside the step: those held."""
        return held


@dataclass(frozen=True)
class Smooth:
    """`tanh(speed / width)` friction, for whoever wants a smooth vector field.

    `width` is in units of the rubbing speed. The sub-step has to resolve the width; see the documentation page on dry
    friction for the error it leaves.
    """

    width: float

    def held(self, robot: Robot, state: State, inputs: Scalars, h, p: Numbers) -> Scalars:
        """Nothing is held: the law is evaluated at every stage."""
        return ()

    def present(self, robot: Robot, state: State, held: Scalars, p: Numbers) -> Scalars:
        """Friction torques at this state."""
        torques = []
        for speed, (backward, forward) in zip(robot.rubbing(state, p), robot.coulomb(state, p), strict=True):
            level = jnp.where(speed >= 0, forward, backward)
            torques.append(level * jnp.tanh(speed / self.width))
        return tuple(torques)


DryFriction = Sticking | Smooth
