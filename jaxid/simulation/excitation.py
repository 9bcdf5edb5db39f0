"""The family of drivable inputs, from which experiments are chosen: directions of driving times shapes over time.

A shape is a signal of unit amplitude; a mode is a direction in which a robot's inputs are driven together. Proposing what
to record next (`explain`) and designing an experiment (`estimate`) both choose from here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..logs import Channels, signals
from ..robots.robot import Robot

Array = NDArray[np.float64]
Direction = tuple[float, ...]

_CLOCKS = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Clock periods of binary sequences, in rise times of the robot."""
_BANDS = (0.25, 0.5, 1.0)
"""Upper ends of the multisines' bands, in cycles per rise time."""
_LINES = 24


@dataclass(frozen=True)
class Drive:
    """Inputs [T, nu] that can be driven, and how: "straight with a step ... at 6 V"."""

    description: str
    inputs: Array


def modes(robot: Robot) -> Mapping[str, Direction]:
    """Directions of driving by name; each input on its own for a robot that names none, one input unnamed."""
    inputs = robot.channels.inputs
    if len(inputs) == 1:
        return {"": (1.0,)}
    single = {name: tuple(float(i == k) for i in range(len(inputs))) for k, name in enumerate(inputs)}
    return robot.driving_modes or single


def plain_shapes(duration: float, interval: float) -> dict[str, Array]:
    """Signals of unit amplitude for a robot of which nothing is known, [T] each: their parts are shares of the `duration`."""
    n = round(duration / interval)
    begin, forward, back = round(0.05 * n), round(0.4 * n), round(0.4 * n)
    back_and_forth = np.zeros(n)
    back_and_forth[begin : begin + forward] = 1.0
    back_and_forth[begin + forward : begin + forward + back] = -1.0
    run = np.ones(n)
    run[: max(round(0.025 * n), 1)] = 0.0
    return {"a step forwards and back": back_and_forth, "one long run": run}


def binary(duration: float, interval: float, clock: float) -> Array:
    """A PRBS of unit amplitude with a clock period of about `clock` [s], long enough not to repeat, [T]."""
    n, hold = round(duration / interval), max(round(clock / interval), 1) * interval
    order = int(np.clip(np.ceil(np.log2(duration / hold + 2)), 4, 12))
    return np.resize(signals.prbs(order, 1.0, hold, interval, seed=3), n)


def tuned_shapes(duration: float, interval: float, rise: float) -> dict[str, Array]:
    """Signals of unit amplitude that suit a robot whose speed rises to 63 % within `rise` seconds of a step, [T] each."""
    n, nyquist = round(duration / interval), 0.5 / interval
    shapes = {}
    for clock in _CLOCKS:
        period = max(round(clock * rise / interval), 1) * interval
        shapes[f"a random binary sequence with a clock of {period:.2g} s"] = binary(duration, interval, period)
    for hold in (1.0, 3.0, 8.0):
        period = max(round(hold * rise / interval), 1) * interval
        levels = [-1.0, -0.6, -0.3, 0.3, 0.6, 1.0]
        shapes[f"random levels held for {period:.2g} s"] = signals.multilevel(levels, period, duration, interval, 5)
    for steps in ((0.3, 0.65, 1.0, 0.5, 0.0, -0.3, -0.65, -1.0, -0.5, 0.0), (1.0, -1.0, 0.5, -0.5, 0.25, -0.25)):
        title = "a staircase up and down" if len(steps) == 10 else "steps forwards and back, ever smaller"
        shapes[title] = np.asarray(steps)[np.arange(n) * len(steps) // n]
    last = min(0.7 / rise, 0.8 * nyquist)
    shapes[f"a sweep to {last:.2g} Hz"] = signals.chirp(1.0, 0.0, last, duration, interval)
    for band in _BANDS:
        top = min(band / rise, 0.8 * nyquist)
        lines = np.unique(np.round(np.geomspace(1, max(top * duration, 2), _LINES))) / duration
        for decay in (0.0, 0.5):
            falling = "" if decay == 0 else ", power falling as 1/f"
            shapes[f"a multisine to {top:.2g} Hz{falling}"] = signals.multisine(1.0, lines, duration, interval, decay)
    return {name: np.resize(np.asarray(s, float).ravel(), n) for name, s in shapes.items()}


def shifted(shape: Array, count: int) -> Array:
    """`count` versions [T, count] of a signal, each started elsewhere in it, so that they hardly correlate."""
    return np.stack([np.roll(shape, k * len(shape) // count) for k in range(count)], axis=-1)


def together(shape: Array, directions: Sequence[Direction]) -> Array:
    """All directions driven at once, each with its own version of the shape, peaking at one: [T, nu]."""
    inputs = shifted(shape, len(directions)) @ np.asarray(directions)
    return inputs / max(float(np.max(np.abs(inputs))), 1e-300)


def in_turn(shape: Array, directions: Sequence[Direction]) -> Array:
    """One direction after another, for equal parts of the time, peaking at one: [T, nu]."""
    which = np.arange(len(shape)) * len(directions) // len(shape)
    inputs = shape[:, None] * np.asarray(directions)[which]
    return inputs / max(float(np.max(np.abs(inputs))), 1e-300)


def _amount(channels: Channels, which: Sequence[int], size: float, share: float) -> str:
    """How large the inputs at `which` places are, in their unit or, where they have several, as a share of what each may be."""
    units = {channels.units.get(channels.inputs[i], "") for i in which}
    return f"{size:.3g} {units.pop()}".strip() if len(units) == 1 else f"{100 * share:.3g} % of what each input may be"


def single_modes(robot: Robot, shapes: Mapping[str, Array], shares: Sequence[float], largest: Array) -> list[Drive]:
    """Every mode with every shape, as large as each of the `shares` of the `largest` inputs [nu] allows."""
    family = []
    for mode, direction in modes(robot).items():
        gains = np.asarray(direction, float)
        driven = [int(i) for i in np.flatnonzero(gains)]
        size = float(np.min(largest[driven] / np.abs(gains[driven])))
        for shape, signal in shapes.items():
            for share in shares:
                where = f"{mode} with " if mode else "with "
                title = f"{where}{shape} at {_amount(robot.channels, driven, share * size, share)}"
                family.append(Drive(title, share * size * signal[:, None] * gains))
    return family


def combined_modes(
    channels: Channels, shapes: Mapping[str, Array], shares: Sequence[float], largest: Array
) -> list[Drive]:
    """Motions (by the channels' `mixing`) in turn and all at once, and inputs all on their own, each as large as the `shares`
    of its `largest` [nu]. Empty for one input."""
    count = len(channels.inputs)
    if count == 1:
        return []
    single = [tuple(float(i == k) for i in range(count)) for k in range(count)]
    motions = [tuple(float(v) for v in gains) for gains in channels.mixing.values()]
    ways = {"every input on its own": (together, single)}
    if len(motions) > 1:
        ways |= {"all motions at once": (together, motions), "one motion after another": (in_turn, motions)}
    size = float(np.max(largest))
    return [
        Drive(
            f"{way} with {shape} at {_amount(channels, range(count), share * size, share)}",
            share * largest * combine(signal, directions),
        )
        for way, (combine, directions) in ways.items()
        for shape, signal in shapes.items()
        for share in shares
    ]
