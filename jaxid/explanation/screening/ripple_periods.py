"""At which periods a force repeats with an angle or a place: the periodogram of the missing force over the way driven.

The missing force (`missing_force`), let wander freely, is held against cosine and sine of every period between a few along
the way and what samples at the robot's slower speeds still resolve, and against these times the drive torque, as where the
torque itself ripples: the least-squares periodogram of unevenly spaced data (Lomb, Astrophysics and Space Science 39, 1976;
Scargle, Astrophysical Journal 263, 1982), its sums taken by FFT from a histogram over the way. Nothing hangs on a unit, and no
period is likelier than another.

Hundreds to thousands of periods are looked at, and neither the force's own colour nor the way is even. So a peak counts only
if it is higher than the highest of the same force moved to random moments of the same runs, each period in units of what
these have there on average: a permutation test of the maximum (Westfall & Young, Resampling-Based Multiple Testing, 1993),
whose upper quantile is that of Gumbel's distribution with the mean and the spread of a few.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax
import numpy as np
import scipy
from numpy.typing import NDArray

from ..._float64 import in_float64
from ...logs import LogSet
from ...robots.robot import Robot
from ..where.force_filter import PREFIX
from ..where.missing_force import NoVelocities, Smoothed, smoothed_states

Array = NDArray[np.float64]

_WANDER = 6.0
"""Random-walk intensity of the missing forces, in units of `ForceHistory.scale` per root of its response time: enough for
one that changes its sign within a few samples."""
_FEWEST = 2.0
"""Cycles along the longest way that are told from a force which changes with the place."""
_SLOWER = 0.25
"""Quantile of the speeds in motion at which the finest period still has two samples."""
_MOVES = 0.03
"""Share of the fastest speed from which an angle moves."""
_OVERSAMPLED = 4
"""Steps of the grid for every cycle more along the way."""
_CELLS = 4
"""Places of the histogram in half of the finest period, of whose amplitude 10 % are lost."""
_MOST = 2**16
"""Most steps of the grid; the finest periods are left out beyond."""
FALSE_ALARM = 0.05
"""Probability of any peak where the force repeats with nothing."""
_SHIFTS, _TOGETHER = 96, 8
"""Random shifts of the force that are held against it, and how many are transformed at a time."""
_SEED = 22
_PEAKS = 8


class Periods(NamedTuple):
    """`values` [rad per unit of the angle] of the peaks, most significant first, and how many were told apart in the search."""

    values: tuple[float, ...]
    looked_at: int


class Ripples(NamedTuple):
    """Periods of a force of one size, and of one in proportion to the drive torque."""

    steady: Periods
    by_torque: Periods


NO_RIPPLES = Ripples(Periods((), 0), Periods((), 0))


class Grid:
    """Periods that a way [N] can tell apart, up to the `finest`, and sums over the way at each of them."""

    def __init__(self, way: Array, finest: float):
        self.step = 2 * np.pi / (float(np.ptp(way)) * _OVERSAMPLED)
        self.steps = int(min(finest / self.step, _MOST))
        self.size = 2 ** int(np.ceil(np.log2(4 * _CELLS * max(self.steps, 1))))
        cell = 2 * np.pi / (self.size * self.step)
        at = np.minimum(((way - way.min()) / cell).astype(int), self.size - 1)
        self.order = np.argsort(at, kind="stable")
        self.cells, self.first = np.unique(at[self.order], return_index=True)

    @property
    def periods(self) -> Array:
        """Radians per unit of the way [M]."""
        return np.asarray(self.step * np.arange(1, self.steps + 1), np.float64)

    def sums(self, values: NDArray[np.floating], steps: int) -> NDArray[np.complexfloating]:
        """Sums of `values` [*signals, N] times exp(i k way) for k from 0 to `steps`."""
        rows = values.reshape(-1, values.shape[-1])
        binned = np.zeros((len(rows), self.size), values.dtype)
        binned[:, self.cells] = np.add.reduceat(rows[:, self.order], self.first, axis=1)
        found = scipy.fft.rfft(binned, axis=1, overwrite_x=True)[:, : steps + 1]
        return np.conj(found).reshape(*values.shape[:-1], steps + 1)


class Periodogram:
    """The part of a signal's weighted squares that each period of a `grid` reproduces; `weight` [N] is one for all signals."""

    def __init__(self, grid: Grid, weight: Array):
        k = np.arange(1, grid.steps + 1)
        weights = grid.sums(weight, 2 * grid.steps)
        whole, double = float(weights[0].real), weights[2 * k]
        cc, ss, cs = 0.5 * (whole + double.real), 0.5 * (whole - double.real), 0.5 * double.imag
        determinant = np.maximum(cc * ss - cs**2, 1e-12 * whole**2)
        self.grid = grid
        self.cosine, self.mixed, self.sine = ss / determinant, -2 * cs / determinant, cc / determinant

    def __call__(self, products: NDArray[np.floating]) -> Array:
        """The part at each period [*signals, M]; `products` [*signals, N] are weight times signal."""
        sums = self.grid.sums(products, self.grid.steps)[..., 1:]
        return self.cosine * sums.real**2 + self.mixed * sums.real * sums.imag + self.sine * sums.imag**2


def _of_one(values: Array) -> Array:
    """The same in units of the largest."""
    return values / max(float(np.max(np.abs(values))), np.finfo(float).tiny)


def _finest(moved: Array) -> float:
    """The largest period [rad per unit] of which two samples a cycle are left at the slower speeds; `moved` per sample."""
    moved = np.abs(moved)
    moving = moved[moved > _MOVES * float(np.quantile(moved, 0.95))]
    return float(np.pi / np.quantile(moving, _SLOWER)) if moving.size else 0.0


def _highest(heights: Array, false_alarm: float) -> float:
    """What the largest of many is beyond with probability `false_alarm`, by some `heights` [N] that it had by chance: Gumbel,
    Statistics of Extremes, 1958."""
    scale = float(np.std(heights, ddof=1)) * np.sqrt(6.0) / np.pi
    return float(np.mean(heights)) - scale * (np.euler_gamma + np.log(-np.log1p(-false_alarm)))


def _peaks(
    ways: Sequence[Array], forces: Sequence[Smoothed], false_alarm: float, carriers: Sequence[Array] | None = None
) -> tuple[list[tuple[float, float, float]], int]:
    """Peaks of the forces of every log over the way, or of what they are in units of `carriers`, as (height over the highest
    that chance reaches with probability `false_alarm`, period, what is one cycle more along the way), and how many periods were
    told apart."""
    way = np.concatenate(ways)
    mean, std = (np.concatenate([np.asarray(part) for part in parts]) for parts in zip(*forces, strict=True))
    longest = max(float(np.ptp(own)) for own in ways)
    if not (longest > 0 and all(np.all(np.isfinite(x)) for x in (way, mean, std)) and np.all(std > 0)):
        return [], 0
    grid = Grid(way, _finest(np.concatenate([np.diff(own) for own in ways])))
    kept = grid.periods >= _FEWEST * 2 * np.pi / longest
    looked_at = int(np.count_nonzero(kept)) // _OVERSAMPLED
    if not looked_at:
        return [], 0
    # Everything is a ratio, so that forces that a runaway fit leaves (1e200 N) need not overflow.
    weight = (np.min(std) / std) ** 2
    mean = _of_one(mean)
    carrier = np.ones(len(mean)) if carriers is None else _of_one(np.concatenate(carriers))
    squares = np.sum(weight * carrier**2)
    if not squares > 0:
        return [], 0
    products = weight * (mean - carrier * np.sum(weight * carrier * mean) / squares)
    # Single precision is enough for what chance makes of it.
    products = _of_one(products).astype(np.float32)
    parts, carrier32 = np.split(products, np.cumsum([len(own) for own in ways])[:-1]), carrier.astype(np.float32)
    rng = np.random.default_rng(_SEED)
    power = Periodogram(grid, weight * carrier**2)
    shifted = [np.concatenate([np.roll(own, rng.integers(len(own))) for own in parts]) for _ in range(_SHIFTS)]
    some = range(0, _SHIFTS, _TOGETHER)
    moved = np.concatenate([power(carrier32 * np.stack(shifted[k : k + _TOGETHER]))[:, kept] for k in some])
    # Of neighbouring periods chance makes much the same.
    usual = scipy.ndimage.uniform_filter1d(np.mean(moved, axis=0), 2 * _OVERSAMPLED + 1, mode="nearest")
    usual = np.maximum(usual, np.finfo(float).tiny)
    least = _highest(np.max(moved / usual, axis=1), false_alarm)
    products = carrier * products
    height = power(products)[kept] / usual / least
    top = (scipy.ndimage.maximum_filter(height, 2 * _OVERSAMPLED + 1, mode="nearest") == height) & (height > 1.0)
    one = grid.step * _OVERSAMPLED
    return [(float(height[i]), float(grid.periods[kept][i]), one) for i in np.flatnonzero(top)], looked_at


def _torques(robot: Robot, logs: LogSet, own: Mapping[str, Sequence[Smoothed]]) -> list[list[Array]]:
    """The drive torque of every axis in each of the logs [axes][logs][T], by the smoothed states of `own`."""
    state = {name: np.concatenate([np.asarray(part.mean) for part in parts]) for name, parts in own.items()}
    inputs = tuple(np.concatenate([log.inputs for log in logs]).T)
    numbers = robot.parameters.numbers
    ends = np.cumsum([len(log) for log in logs])[:-1]
    found = jax.vmap(lambda s, u: robot.drive_torques(u, s, numbers))(state, inputs)
    return [np.split(np.nan_to_num(np.asarray(torque, float)), ends) for torque in found]


@in_float64
def ripple_periods(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float],
    known_states: Mapping[str, Mapping[str, float]],
) -> Ripples:
    """The periods at which the force that `robot` misses repeats with one of its `angles`, and at which it does in proportion
    to the drive torque there.

    `noise` is the measurement noise by channel, `known_states` estimated initial states by log name. Empty where nothing
    stands out, and for a robot that integrates no angles or does not say which of its states forces accelerate.
    """
    try:
        found = smoothed_states(robot, logs, noise, known_states, _WANDER)
    except NoVelocities:
        return NO_RIPPLES
    own = {name: [Smoothed(m[: len(log)], s[: len(log)]) for m, s, log in zip(*state, logs, strict=True)]
           for name, state in found.items()}  # fmt: skip
    angles = [name for name in robot.angles if name in own]
    torques = _torques(robot, logs, own) if angles == list(robot.angles) else []
    forces = [name for name in own if name.startswith(PREFIX)]

    def periods(carriers: Sequence[list[Array] | None]) -> Periods:
        peaks: list[tuple[float, float, float]] = []
        looked_at = 0
        for angle, carrier in zip(angles, carriers, strict=True):
            ways = [np.asarray(state.mean) for state in own[angle]]
            for force in forces:
                heights, count = _peaks(ways, own[force], FALSE_ALARM / (len(angles) * len(forces)), carrier)
                peaks, looked_at = peaks + heights, looked_at + count
        chosen: list[float] = []
        for _, period, apart in sorted(peaks, reverse=True):
            if len(chosen) < _PEAKS and all(abs(period - other) > apart for other in chosen):
                chosen.append(period)
        return Periods(tuple(chosen), looked_at)

    return Ripples(periods([None] * len(angles)), periods(torques) if len(torques) == len(angles) else Periods((), 0))
