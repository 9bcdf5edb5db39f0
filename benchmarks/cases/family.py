"""What every family of cases has: a simulator in handy units, the user's model, and how units turn one into the other."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

import jaxid

Rng = np.random.Generator
Numbers = dict[str, float]


@dataclass(frozen=True)
class Units:
    """Size of the user's units: one second, metre, kilogram and input of the simulator in units of the user's log."""

    time: float
    length: float
    mass: float
    input: float

    @property
    def speed(self) -> float:
        return self.length / self.time

    @property
    def force(self) -> float:
        return self.mass * self.length / self.time**2

    @property
    def torque(self) -> float:
        return self.force * self.length

    @property
    def inertia(self) -> float:
        return self.mass * self.length**2


@dataclass(frozen=True)
class Family:
    """One kind of robot.

    - `draw(rng)`: parameters of the simulator; `excite(rng, n, kind, p)`: its inputs [n, m].
    - `states(p, effects, start, time, inputs, forces)`: states [n, ...] at uneven times.
    - `see(states, p)`: its outputs [n, ny]. `move(rng, p)`: a start in motion.
    - `model(p, units)`: the user's robot with the true numbers, free ones and fixed ones, in the user's units.
    - `output_units(units)`, `input_units(units)`: factors by channel.
    - `forces(p)`: typical size of each external force, for process noise.
    - `effects`: {condition: function of (rng, p) -> effects}, what can be hidden.
    """

    name: str
    share: float
    draw: Callable[[Rng], Numbers]
    excite: Callable[[Rng, int, str, Numbers], np.ndarray]
    states: Callable[..., np.ndarray]
    see: Callable[[np.ndarray, Numbers], np.ndarray]
    move: Callable[[Rng, Numbers], np.ndarray]
    rest: Callable[[Numbers], np.ndarray]
    model: Callable[[Numbers, Units], jaxid.Robot]
    output_units: Callable[[Units], tuple[float, ...]]
    input_units: Callable[[Units], tuple[float, ...]]
    forces: Callable[[Numbers], tuple[float, ...]]
    effects: Mapping[str, Callable[[Rng, Numbers], dict]]
    has_length: bool = True
    """Whether lengths have a unit that can change (a pendulum's angle has none)."""
    angle_outputs: tuple[int, ...] = ()


def levels(rng: Rng, n: int, hold: tuple[int, int], low: float, high: float) -> np.ndarray:
    """Random levels in [low, high], each held for hold[0] to hold[1] samples [n]."""
    out = np.empty(0)
    while out.size < n:
        out = np.append(out, np.full(rng.integers(hold[0], hold[1] + 1), rng.uniform(low, high)))
    return out[:n]


def signal(rng: Rng, n: int, kind: str, size: float, least: float) -> np.ndarray:
    """One input [n]: "good" (levels of both signs, up to `size`, well above `least`, which just moves the robot), "weak"
    (hardly above it), "one way" (never reversing), "step" (a single one)."""
    if kind == "weak":
        return levels(rng, n, (10, 40), -1.2 * least - 0.05 * size, 1.3 * least + 0.07 * size)
    if kind == "one way":
        return levels(rng, n, (10, 40), least + 0.3 * size, least + size)
    if kind == "step":
        return np.where(np.arange(n) < 20, 0.0, least + rng.uniform(0.4, 1.0) * size)
    out = levels(rng, n, (8, 45), -1.0, 1.0)
    return np.sign(out) * (np.abs(out) * size + least * rng.uniform(0.5, 1.0))


def between(rng: Rng, low: float, high: float) -> float:
    """A number in [low, high], every magnitude as likely as the other."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def free(value: float, positive: bool = True) -> jaxid.Parameter:
    """A free parameter as users write them."""
    return jaxid.Parameter(value, free=True, lower=0.0 if positive else -np.inf)
