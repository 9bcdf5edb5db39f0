"""Orders of magnitude of what a robot does, in the units of its own logs.

First guesses of effects (a dead zone of 5 % of the input, a delay of a tenth of the robot's time constant) are shares of
these, so that they do not depend on the units in which somebody logs.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from .._float64 import in_float64

if TYPE_CHECKING:
    from .robot import Robot


@dataclass(frozen=True)
class Scales:
    """Largest drive `input`, and of each of the `inputs` by name; `speed` at the rims of the drive axes; drive `torque` of one
    wheel at the largest input, the `force` at the ground that it is, and the `friction` that would hold a drive axis against
    all of them; the robot's `time` constant; `acceleration`, speed over time constant; `interval` between samples and
    `duration` of a log; `length` of the driven path; `angle` through which one period of a ripple may go; `outputs`:
    amplitude by channel. `farthest`: the magnitude by channel that hardly a sample exceeds, as far as a curve has to reach
    (none: `outputs`), `whole` the same of the whole translation (zero: of its first part), and `fastest` of the rims'
    speeds (zero: `speed`), forward and backward in `fastest_by_way`. `way`: where the one angle of a robot on a line begins
    and ends."""

    input: float = 10.0
    speed: float = 1.0
    torque: float = 25.0
    force: float = 50.0
    friction: float = 50.0
    time: float = 0.2
    acceleration: float = 6.0
    interval: float = 0.02
    duration: float = 20.0
    length: float = 7.0
    angle: float = 1.0
    outputs: Mapping[str, float] = field(default_factory=dict)
    inputs: Mapping[str, float] = field(default_factory=dict)
    farthest: Mapping[str, float] = field(default_factory=dict)
    whole: float = 0.0
    fastest: float = 0.0
    fastest_by_way: Mapping[str, float] = field(default_factory=dict)
    way: tuple[float, float] | None = None

    @property
    def rim_reach(self) -> float:
        """How far a curve over the speed at the rims has to reach."""
        return max(self.fastest, self.speed)

    def rim_fastest_of(self, way: str = "") -> float:
        """The fastest that the rims go in the logs, that `way`; without any, what the robot makes them."""
        return self.fastest_by_way.get(way, self.fastest or self.speed)

    def reach(self, channel: str) -> float:
        """How far a curve over an output has to reach."""
        return self.farthest.get(channel, self.output(channel))

    def output(self, channel: str) -> float:
        """Amplitude of an output."""
        return self.outputs.get(channel, self.speed)

    def input_of(self, name: str) -> float:
        """Largest magnitude of an input."""
        return self.inputs.get(name, self.input)

    @property
    def times_to_try(self) -> tuple[float, ...]:
        """Delays and time constants that a first look tries: from half a sample to what the robot's own would hide."""
        first, last = 0.5 * self.interval, max(0.4 * self.time, 4.0 * self.interval)
        return first, float(np.sqrt(first * last)), last

    @property
    def ramps_to_try(self) -> tuple[float, ...]:
        """Times from standstill to the largest input that a first look tries: soft starts take as long as their owner likes,
        however quick the robot is."""
        return (*self.times_to_try, *(many * self.times_to_try[-1] for many in (4.0, 16.0)))


_STEP = 1e-6
"""Step of the central differences; at rest the rates are all but linear."""


def time_constant(robot: "Robot") -> float:
    """The shortest time constant of the robot's own motion at rest, without dry friction and without its effects.

    One over the largest magnitude among the eigenvalues of its linearised rates; infinite for what only coasts.
    """
    # Models that differ in their effects alone have one; looked up by what it depends on.
    of_effects = tuple(effect.key("") for effect in robot.effects)
    numbers = robot.parameters.numbers.items()
    own = tuple((name, float(value)) for name, value in numbers if not name.startswith(of_effects))
    return _time_constant(replace(robot.alone, effects=()).structure, own)


@lru_cache(512)
@in_float64
def _time_constant(bare: "Robot", numbers: tuple[tuple[str, float], ...]) -> float:
    # NumPy's numbers: a mass of zero makes infinity, which is looked for, and no error.
    p = {name: np.float64(value) for name, value in numbers}
    names, rest = bare.own_states, bare.initial_state()
    idle = (0.0,) * len(bare.channels.inputs)
    dry = (0.0,) * len(bare.rubbing(rest, p))

    def rates(name: str, step: float) -> np.ndarray:
        found = bare.rates({**rest, name: rest[name] + step}, idle, dry, p)
        return np.array([float(np.asarray(found[n])) for n in names])

    with np.errstate(all="ignore"):
        matrix = np.stack([(rates(n, _STEP) - rates(n, -_STEP)) / (2 * _STEP) for n in names], axis=1)
    if not np.all(np.isfinite(matrix)):
        return float("inf")
    fastest = float(np.max(np.abs(np.linalg.eigvals(matrix)), initial=0.0))
    return 1.0 / fastest if fastest > 0 else float("inf")
