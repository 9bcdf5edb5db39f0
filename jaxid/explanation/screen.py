"""Screening: which effects could explain what the fitted model leaves over.

The score (Lagrange-multiplier) test with finite steps: the change that each candidate makes to the simulation at the
baseline fit, projected off the changes that the fitted parameters can make themselves, is compared with the residual.
All candidates stand in one model, absent (zero) but for the one a simulation probes, so that one compiled program
simulates them all as lanes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import jax
import numpy as np
from numpy.typing import NDArray

from .._arrays import array
from .._compile import compiled
from .._float64 import in_float64
from ..estimate.noise_colour import colour_of
from ..logs import LogSet
from ..robots.effect import Effect
from ..robots.robot import Robot
from ..simulation.direct import simulated_directly
from ..simulation.integrated_angles import integrated_angles
from ..simulation.rollout import Integrator, rollout
from ..simulation.simulate import integrator_for
from ..simulation.start import initial_states
from .probes import Group, groups, lanes
from .ripple_periods import Periods, ripple_periods
from .smoothed_angles import Angles

_STARTS = 2
"""Starts that an effect with a shape (a line, a speed, a number of periods) is refitted from."""
_ALIKE = 0.9
_STEP = 1e-3
"""Step of the fitted parameters' secants, in units of their magnitude."""


@dataclass(frozen=True)
class Candidate:
    """One effect's score.

    `gain` is the drop of the sum of squares (in units of the noise) that the effect promises with all fitted parameters
    re-estimated, to first order, less what its parameters and the shapes looked at cost; `in_colour` the same of the whitened
    residual, what the best candidate leaves taken for coloured noise; `share` the part of the excess over the noise floor;
    `starts` the values to begin refits from, best first. `direction` is the change of the simulation (in
    units of the noise, fitted parameters projected off, of length one) by which it explains. `out_of` is how many shapes of it
    were looked at.
    """

    effect: Effect
    gain: float
    share: float
    starts: tuple[dict[str, float], ...]
    direction: NDArray[np.float32] = field(repr=False, compare=False)
    out_of: int = 1
    in_colour: float = 0.0

    def like(self, other: "Candidate") -> bool:
        """Whether the two explain by the same change, so that only refits can tell them apart."""
        return abs(float(self.direction @ other.direction)) > _ALIKE


@partial(compiled, static_argnames=("robot", "integrator"))
def _lanes(robot: Robot, integrator: Integrator, numbers, changes, start, inputs, dt, prescribed):
    """Simulated outputs [P, E, T, ny] for parameters `numbers` with `changes` ([P] by name) put in."""

    def one(change):
        p = {**numbers, **change}
        return jax.vmap(lambda s, u, d, k: rollout(robot, p, s, u, d, integrator, k))(start, inputs, dt, prescribed)

    return jax.lax.map(one, changes, batch_size=16)


def _simulate(
    robot: Robot, integrator: Integrator, logs: LogSet, changes: Sequence[Mapping[str, float]], states, prescribed
) -> NDArray[np.float64]:
    """Whitening left aside: simulated outputs [P, samples x channels] at the logs' measured places."""
    batch = logs.batch()
    base = robot.parameters.numbers
    every = {name: np.array([change.get(name, value) for change in changes], float) for name, value in base.items()}
    found = simulated_directly(robot, integrator, every, states, batch.inputs, batch.dt, prescribed)
    if found is not None:
        return found
    padded = list(changes) + [{}] * (-len(changes) % 16)
    names = sorted({name for change in changes for name in change})
    columns = {name: array([change.get(name, base[name]) for change in padded]) for name in names}
    numbers = {name: array(float(value)) for name, value in base.items()}
    outputs = _lanes(robot.structure, integrator, numbers, columns, states, batch.inputs, batch.dt, prescribed)
    return np.asarray(outputs)[: len(changes)]


@in_float64
def screen(
    robot: Robot,
    logs: LogSet,
    effects: Sequence[Effect],
    noise: Mapping[str, float],
    known_states: Mapping[str, Mapping[str, float]],
    angles: Angles | None = None,
) -> list[Candidate]:
    """Score `effects` on a fitted `robot` that lacks them, best first.

    `known_states` are estimated initial states, `angles` those of the wheels if they have to be prescribed.
    """
    own = list(robot.parameters.free_names)
    full = robot
    for effect in effects:
        full = full + effect
    repeating = Periods((), 0)
    for effect in effects:
        repeating = ripple_periods(robot + effect, logs, noise, known_states) if effect.repeats else repeating
    found: list[Group] = [group for effect in effects for group in groups(effect, full, logs, repeating)]
    changes, columns = lanes(found)
    steps = [max(abs(robot.parameters[name].value), robot.parameters[name].typical or 0.0) * _STEP for name in own]
    base = robot.parameters.numbers
    secants = [{name: base[name] + step} for name, step in zip(own, steps, strict=True)]
    states = dict(initial_states(full, logs).states)
    for e, log in enumerate(logs):
        for name, value in known_states.get(log.name, {}).items():
            states[name][e] = value
    states = {name: array(value) for name, value in states.items()}
    prescribed = dict(angles or integrated_angles(full, logs))
    outputs = _simulate(full, integrator_for(robot, logs), logs, [{}, *secants, *changes], states, prescribed)
    weights, measured = _weights(robot, logs, {name: level for name, level in noise.items() if name not in prescribed})
    residual = (np.where(weights > 0, outputs[0] - measured, 0.0) * weights).ravel()
    moved = ((outputs[1:] - outputs[0]) * weights).reshape(len(secants) + len(changes), -1)
    moved = np.where(np.all(np.isfinite(moved), axis=1, keepdims=True), moved, 0.0)
    basis, triangle = np.linalg.qr(moved[: len(own)].T)
    whole = residual
    residual = residual - basis @ (basis.T @ residual)
    excess = max(float(residual @ residual) - np.count_nonzero(weights), 1.0)
    scored: dict[str, list[tuple[float, dict[str, float], dict[str, float], Group, NDArray[np.float32]]]] = {}
    explained = 0.0, np.zeros_like(residual)
    for group, mine in zip(found, columns, strict=True):
        block = moved[len(own) :][mine]
        block = block - (block @ basis) @ basis.T
        useful = np.linalg.norm(block, axis=1) > 1e-6
        if not useful.any():
            continue
        names = [name for name, ok in zip(group.strengths, useful, strict=True) if ok]
        gain, start, change = _promise(full, group, names, block[useful], residual)
        # How the fitted parameters would give way, to first order: what the effect had been mistaken for.
        plain = moved[len(own) :][mine][useful]
        size = _sizes(group, names, start)
        shift = -np.linalg.lstsq(triangle, basis.T @ (whole + plain.T @ size), rcond=1e-6)[0] * np.array(steps)
        given_way = {n: _inside(robot, n, base[n] + d) for n, d in zip(own, shift, strict=True)}
        score = gain - _price(group, names, residual)
        explained = max(explained, (score, change), key=lambda entry: entry[0])
        direction = (change / max(float(np.linalg.norm(change)), 1e-300)).astype(np.float32)
        scored.setdefault(group.effect.id, []).append((score, start, given_way, group, direction))
    in_colour = _in_colour(full, found, columns, residual + explained[1], whole, moved, len(own), weights)
    candidates = []
    for tried in scored.values():
        tried.sort(key=lambda entry: -entry[0])
        score, _, _, group, direction = tried[0]
        best = tried[: _STARTS if len(tried[0][1]) > 1 else 1]
        starts = tuple(start for entry in best for start in (entry[1], {**entry[2], **entry[1]}))
        share = float(score / excess)
        coloured = in_colour.get(group.effect.id, float(score))
        candidates.append(Candidate(group.effect, float(score), share, starts, direction, group.out_of, coloured))
    return sorted(candidates, key=lambda candidate: -candidate.gain)


def _price(group: Group, names: Sequence[str], residual: NDArray) -> float:
    """What the gain of a group must pay for its parameters and for the shapes looked at."""
    return len(names) * float(np.log(residual.size)) + 2.0 * float(np.log(group.out_of))


def _in_colour(
    full: Robot,
    found: Sequence[Group],
    columns: Sequence[list[int]],
    left: NDArray,
    whole: NDArray,
    moved: NDArray,
    own: int,
    weights: NDArray,
) -> dict[str, float]:
    """The gains of effects once all is whitened as what the best one leaves (`left`) asks for; empty where that is white.

    `whole` is the residual and `moved` [P, E T ny] the changes, of the `own` fitted parameters first, all in units of the
    noise. Gains are then in units of independent samples, which those of coloured noise are not.
    """
    there = weights > 0
    parts = np.where(there, left.reshape(weights.shape), np.nan)
    colours = [colour_of(list(parts[:, :, i])) for i in range(weights.shape[2])]
    if not any(colour.order for colour in colours):
        return {}
    every = np.vstack([whole, moved]).reshape(-1, *weights.shape)
    white = np.zeros_like(every)
    for i, colour in enumerate(colours):
        for e in range(len(weights)):
            white[:, e, :, i] = colour.whiten(every[:, e, :, i], there[e, :, i])
    white = white.reshape(len(every), -1)
    basis, _ = np.linalg.qr(white[1 : 1 + own].T)
    residual = white[0] - basis @ (basis.T @ white[0])
    gains: dict[str, float] = {}
    for group, mine in zip(found, columns, strict=True):
        block = white[1 + own :][mine]
        block = block - (block @ basis) @ basis.T
        useful = np.linalg.norm(block, axis=1) > 1e-6
        if useful.any():
            names = [name for name, ok in zip(group.strengths, useful, strict=True) if ok]
            gain = _promise(full, group, names, block[useful], residual)[0] - _price(group, names, residual)
            gains[group.effect.id] = max(gain, gains.get(group.effect.id, -np.inf))
    return gains


def _sizes(group: Group, names: Sequence[str], start: Mapping[str, float]) -> NDArray:
    """The start's strengths in units of the probes'."""
    if group.limit is None:
        return np.array([start[name] / group.strengths[name] for name in names])
    return np.array([(group.limit - 1 / start[name]) / (group.limit - 1 / group.strengths[name]) for name in names])


def _inside(robot: Robot, name: str, value: float) -> float:
    """A start for a parameter that a first-order step may have taken out of its bounds."""
    now, lower, upper = (getattr(robot.parameters[name], field) for field in ("value", "lower", "upper"))
    value = max(value, lower + 0.05 * abs(now - lower)) if np.isfinite(lower) else value
    return min(value, upper - 0.05 * abs(upper - now)) if np.isfinite(upper) else value


def _promise(
    full: Robot, group: Group, names: list[str], block: NDArray, residual: NDArray
) -> tuple[float, dict[str, float], NDArray]:
    """Drop of the sum of squares to first order, the parameters at which it is expected, and the change that makes it."""
    coefficients, *_ = np.linalg.lstsq(block.T, -residual, rcond=1e-8)
    if group.limit is not None:
        # What a limit cuts off grows with its distance from the largest signal.
        c = float(np.clip(coefficients[0], 0.0, 1.5))
        name, probe = names[0], 1.0 / group.strengths[names[0]]
        start = {name: 1.0 / (group.limit - c * (group.limit - probe))} if c > 0 else {name: group.strengths[name]}
        return float(-2 * c * block[0] @ residual - c**2 * block[0] @ block[0]), start, c * block[0]
    change = block.T @ coefficients
    gain = float(-change @ residual)
    values = {name: float(c * group.strengths[name]) for name, c in zip(names, coefficients, strict=True)}
    # A strength that must be positive explains nothing with the wrong sign.
    if len(values) == 1 and any(value < full.parameters[name].lower for name, value in values.items()):
        gain = 0.0
    return gain, {**group.shape, **{n: max(value, full.parameters[n].lower) for n, value in values.items()}}, change


def _weights(robot: Robot, logs: LogSet, noise: Mapping[str, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """1/noise where a channel was measured that the fit counts (an output, or a state), and the measurements, [E, T, ny]."""
    batch = logs.batch()
    counted = [name in logs.channels.outputs or name in robot.states for name in batch.channels.measured]
    levels = np.array(
        [noise.get(n, np.nan) if ok else np.nan for n, ok in zip(batch.channels.measured, counted, strict=True)]
    )
    weights = np.where(np.isfinite(levels) & (levels > 0), 1.0 / np.where(levels > 0, levels, 1.0), 0.0)
    return np.where(np.asarray(batch.mask), weights, 0.0), np.asarray(batch.outputs)
