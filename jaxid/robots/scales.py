"""Orders of magnitude of what a robot does, in the units of its own logs.

First guesses of effects (a dead zone of 5 % of the input, a delay of a tenth of the robot's time constant) are shares of
these, so that they do not depend on the units in which somebody logs.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Scales:
    """Largest drive `input`; `speed` at the rims of the drive axes; drive `torque` of one wheel at the largest input, the
    `force` at the ground that it is, and the `friction` that would hold a drive axis against all of them; the robot's
    `time` constant; `acceleration`, speed over time constant; `interval` between samples and `duration` of a log; `length`
    of the driven path; `angle` through which one period of a ripple may go; `outputs`: amplitude by channel."""

    input: float = 1.0
    speed: float = 0.5
    torque: float = 10.0
    force: float = 10.0
    friction: float = 20.0
    time: float = 0.2
    acceleration: float = 2.5
    interval: float = 0.02
    duration: float = 20.0
    length: float = 1.0
    angle: float = 1.0
    outputs: Mapping[str, float] = field(default_factory=dict)

    def output(self, channel: str) -> float:
        """Amplitude of an output."""
        return self.outputs.get(channel, self.speed)
