"""Slow noise of a sensor, or a disturbance of the motion? What is left while the robot stands tells.

Dry friction holds a robot that stands against every force that is smaller, so that a disturbance of the motion does not show
there, while a sensor's noise does.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz, toeplitz

from ..._float64 import in_float64
from ...estimate.jumps import without_jumps
from ...estimate.noise_colour import Colour, colour_of
from ...estimate.output_error.estimated_start import estimated_start
from ...logs import LogSet
from ...logs.noise import usual_size
from ...robots.effect import Effect
from ...robots.robot import Robot
from ...simulation.scaled import Scales
from ...simulation.simulate import integrator_for, simulate
from ..level import current_level
from .heldout import HeldOut

Array = NDArray[np.float64]

_STILL = 1e-9
"""Speed as a share of the largest below which a simulated robot stands: held by dry friction it does exactly."""
_LESS = 0.5
"""Share of a noise's variance below which another one at rest is less, and not the same that drifted."""
_SHORTEST, _LONGEST = 10, 400
"""Samples of a rest that are looked at: of longer ones, in parts."""
_ENOUGH = 100
"""Samples in motion from which a log tells the colour of its own noise."""
_LATE = 3.0
"""Times that dry friction takes to stop a motion as fast as what is left, by which a rest of the robot may be another than the
simulated one's."""
_STEP = 1e-6


Still = list[NDArray[np.bool_]]
"""Where a robot stands [T], of every log."""


def shown_at_rest(
    robot: Robot,
    states: Sequence[tuple[HeldOut, LogSet]],
    still: Sequence[Still],
    colours: Mapping[str, Colour],
    scales: Scales,
    quiet: float = 0.0,
) -> bool | None:
    """Whether the noise of the channels in `colours` is there while `robot` stands (`still`, of every state) as while it moves
    (True: the sensors'), or not at all (False: a disturbance of the motion); None where the logs do not tell, or not the same
    of all channels. Of sensors that at rest show less than `quiet` of it (variance), such as counters, they tell nothing."""
    speeds = list(robot.alone.channels.outputs)
    held = dict(zip(speeds, held_rates(robot), strict=True))
    said = set()
    for name, colour in colours.items():
        logs = [
            (residual[:, list(state.by_channel).index(name)], stood, state.noise[name])
            for (state, _), stands in zip(states, still, strict=True)
            for stood, residual in zip(stands, state.residuals, strict=True)
            if name in state.by_channel and name in speeds
        ]
        moving = np.concatenate([own[~stood & np.isfinite(own)] * noise for own, stood, noise in logs] or [np.empty(0)])
        size = usual_size(moving) if moving.size else np.inf
        # What makes so large a slow error works against viscous friction, and against inertia within its own memory.
        needed = size * (1.0 / scales.time + 1.0 / (max(colour.memory, 1.0) * scales.interval))
        if not held.get(name, 0.0) > needed:
            said.add(None)
            continue
        rests = list(_rests(logs, int(np.ceil(_LATE * size / (held[name] * scales.interval)))))
        # A log that moves too little to tell the colour of its noise says nothing of that, unless all are such.
        own = [_Rest(parts, own) for parts, own in rests if own is not None]
        own = own or [_Rest(parts, colour) for parts, _ in rests]
        said.add(_there(own, colour, quiet))
    return said.pop() if len(said) == 1 else None


def _rests(
    logs: Sequence[tuple[Array, NDArray[np.bool_], float]], late: int
) -> Iterator[tuple[list[Array], Colour | None]]:
    """What is left of each log while its robot stands, and the colour of what is left while it moves. A robot that a
    disturbance drives comes to rest up to `late` samples after the simulated one, and leaves as much before it."""
    for own, stood, _ in logs:
        ends = [(a if a == 0 else a + late, b if b == len(own) else b - late) for a, b in _runs(stood)]
        whole = [own[a:b] for a, b in ends if a < b]
        parts = [p for rest in whole for p in np.array_split(rest, max(-(-len(rest) // _LONGEST), 1))]
        parts = [part[np.isfinite(part)] for part in parts]
        parts = [part for part in parts if len(part) >= _SHORTEST]
        if parts:
            yield parts, _colour_here(own, stood)


def in_motion(states: Sequence[tuple[HeldOut, LogSet]], still: Sequence[Still]) -> list[tuple[HeldOut, LogSet]]:
    """The `states` without what is left while the robot stands (`still`, of every state)."""
    found = []
    for (state, logs), stands in zip(states, still, strict=True):
        moving = tuple(np.where(s[:, None], np.nan, r) for s, r in zip(stands, state.residuals, strict=True))
        found.append((replace(state, residuals=moving), logs))
    return found


def standing(robot: Robot, states: Sequence[tuple[HeldOut, LogSet]]) -> list[Still]:
    """Where the simulated `robot` stands, on the logs of every state."""
    return [_stands(robot, state, logs) for state, logs in states]


def _stands(robot: Robot, state: HeldOut, logs: LogSet) -> Still:
    begun = estimated_start(robot, logs, state.noise)
    speeds = len(robot.alone.channels.outputs)
    # A sensor's bias is there at rest, too: the motion itself is looked at.
    robot = replace(robot, effects=tuple(e for e in robot.effects if type(e).measure is Effect.measure))
    every = [y[:, :speeds] for y in simulate(robot, logs, start=begun, integrator=integrator_for(robot, logs))]
    largest = np.max(
        [np.max(np.abs(y), axis=0) for y in every], axis=0
    )  # not a number where it diverges: it never stands
    return [np.all(np.abs(y) <= _STILL * largest, axis=1) for y in every]


@in_float64
def held_rates(robot: Robot) -> Array:
    """How quickly a force may change each output [ny] of the robot at rest that dry friction just holds, per second; zero where
    none acts."""
    bare = replace(robot.alone, effects=())
    p = {name: np.float64(value) for name, value in bare.parameters.numbers.items()}
    rest = bare.initial_state()
    idle, axes = (0.0,) * len(bare.channels.inputs), len(bare.rubbing(rest, p))
    outputs = len(bare.channels.outputs)

    def seen(dry: tuple[float, ...]) -> Array:
        rates = bare.rates(rest, idle, dry, p)
        steps = [{name: rest[name] + sign * _STEP * rates[name] for name in rest} for sign in (1.0, -1.0)]
        after, before = (np.array([float(np.asarray(y)) for y in bare.observe(own, idle, p)]) for own in steps)
        return (after - before)[:outputs] / (2.0 * _STEP)

    zero = (0.0,) * axes
    if not axes:
        return np.zeros(outputs)
    with np.errstate(all="ignore"):
        slopes = np.stack([seen(tuple(np.eye(axes)[j])) - seen(zero) for j in range(axes)], axis=1)
        levels = np.array([min(abs(float(np.asarray(edge))) for edge in pair) for pair in bare.coulomb(rest, p)])
        if not np.isfinite(slopes).all():
            return np.zeros(outputs)
        torques = np.linalg.pinv(slopes)  # [axes, outputs], of one unit of each output's rate
        reached = np.diag(slopes @ torques) > 1.0 - _STEP
        return np.where(reached, np.min(levels[:, None] / np.maximum(np.abs(torques), 1e-300), axis=0), 0.0)


def _runs(still: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First sample and end of every rest."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= _SHORTEST]


class _Rest(NamedTuple):
    """What is left while the robot stands in one log, `parts` [T], and the `colour` of what is left while it moves there."""

    parts: list[Array]
    colour: Colour

    @property
    def samples(self) -> int:
        return sum(map(len, self.parts))

    @property
    def white(self) -> float:
        """Log-likelihood of white noise of any size."""
        return -0.5 * self.samples * (np.log(self.variance) + 1.0)

    @property
    def variance(self) -> float:
        return max(float(np.mean(np.concatenate(self.parts) ** 2)), 1e-300)

    def coloured(self, colour: Colour | None) -> float:
        """Log-likelihood of noise of this colour, or of its own."""
        colour = colour or self.colour
        covariances = _variance(colour) * colour.correlations[: max(map(len, self.parts))]
        return sum(_log_likelihood(own, covariances[: len(own)]) for own in self.parts)


def _colour_here(residual: Array, stood: NDArray[np.bool_]) -> Colour | None:
    """The colour of what is left while the robot moves in one log, whose noise may be another than that of the others; None
    where it moves too little to tell."""
    moving = residual[~stood & np.isfinite(residual)]
    return colour_of([without_jumps(moving)]) if len(moving) >= _ENOUGH else None


def _there(rests: Sequence[_Rest], colour: Colour, quiet: float) -> bool | None:
    """Whether noise of the `colour` that all logs together have in motion, or of each log's own, is there in the rests: by the
    likelihood ratio to white noise of any size, and, where it is the likelier, to noise of a colour and size of the rests' own,
    which is another noise where it is less. What was fitted to a log has its price (Schwarz)."""
    if not rests:
        return None
    samples = sum(rest.samples for rest in rests)
    variance = sum(rest.samples * _variance(rest.colour) for rest in rests) / samples
    if sum(rest.samples * rest.variance for rest in rests) < quiet * variance * samples:
        return None
    alone = sum(rest.white for rest in rests) - 0.5 * sum(np.log(rest.samples) for rest in rests[1:])
    # Of slow noise a log alone tells little; of logs with another noise each, all together nothing.
    coloured = max(sum(rest.coloured(own) for rest in rests) for own in (colour, None))
    certain = -float(np.log(current_level()))
    if abs(coloured - alone) < certain:
        return None
    if coloured < alone:
        return False
    own = colour_of([part for rest in rests for part in rest.parts])
    price = 0.5 * (own.order + 1) * float(np.log(samples))
    better = sum(rest.coloured(own) for rest in rests) - price - coloured
    if better < certain:
        return True
    return False if _variance(own) < _LESS * variance else None


def _variance(colour: Colour) -> float:
    """Of the stationary noise, by the innovations' and the response to them (Yule and Walker)."""
    rho = colour.correlations[1 : colour.order + 1]
    return colour.level**2 / max(1.0 - float(np.dot(colour.coefficients, rho)), 1e-12)


def _log_likelihood(values: Array, covariances: Array) -> float:
    """Of stationary Gaussian noise, without the constant."""
    _, determinant = np.linalg.slogdet(toeplitz(covariances))
    return -0.5 * float(values @ solve_toeplitz(covariances, values) + determinant)
