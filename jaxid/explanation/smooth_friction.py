"""Dry friction that a user wrote as a steep but smooth function of a speed, which holds no robot at rest.

A `tanh` of the speed over a hundredth of it creeps where a robot sticks. No effect of the catalogue is that difference, so that
what it leaves has no name; the remedy is to declare the friction, which then truly sticks.
"""

from dataclasses import replace

import numpy as np

from .._float64 import in_float64
from ..robots.robot import Robot

_STEEP, _NEAR = 0.2, 0.03
"""Share of what a speed changes of its own rate that is changed within this share of the largest speed around standstill: of
viscous friction the same share is."""


@in_float64
def smoothed_friction(robot: Robot) -> str:
    """A sentence on the speeds of a user's robot near whose standstill its own dynamics bend like smoothed friction; empty
    where there are none, and for robots of this package."""
    if not robot.declared:
        return ""
    # Effects of the catalogue may bend so, which are none of the user's equations.
    own = replace(robot.alone, effects=())
    steep = [name for name in robot.velocities if _is_steep(own, name)]
    if not steep:
        return ""
    return (
        f"Near standstill the dynamics change steeply with {' and '.join(steep)}, as friction written as a smooth function of "
        "a speed does: such a robot creeps where a real one sticks, and that difference has no name. Declare the friction "
        "(`dry_friction=`, or `axes=` with `coulomb`) and take it out of the equations."
    )


def _is_steep(robot: Robot, name: str) -> bool:
    """Whether much of what a speed changes of its own rate is changed close to standstill."""
    p = {key: float(value) for key, value in robot.parameters.numbers.items()}
    rest = {state: float(value) for state, value in robot.initial_state().items()}
    still, nothing = tuple(0.0 for _ in robot.channels.inputs), tuple(0.0 for _ in robot.rubbing(rest, p))
    largest = robot.scales.output(name)

    def braking(share: float) -> float:
        """By how much more the speed falls at this share of the largest one than at as much the other way."""
        ahead, back = ({**rest, name: way * share * largest} for way in (1.0, -1.0))
        return float(robot.rates(back, still, nothing, p)[name] - robot.rates(ahead, still, nothing, p)[name])

    whole = braking(1.0)
    return bool(np.isfinite(whole) and whole > 0.0 and braking(_NEAR) > _STEEP * whole)
