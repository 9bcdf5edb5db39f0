"""Screening: which effects could explain what the fitted model leaves over.

The score (Lagrange-multiplier) test with finite steps: the change that each candidate makes to the simulation at the
baseline fit, projected off the changes that the fitted parameters can make themselves, is compared with the residual.
All candidates stand in one model, absent (zero) but for the one a simulation probes, so that one compiled program
simulates them all as lanes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from .._float64 import in_float64
from ..logs import LogSet
from ..robots.effect import Effect
from ..robots.robot import Robot
from ..simulate.rollout import Integrator, rollout
from ..simulate.simulate import integrator_for
from ..simulate.start import initial_states
from .probes import Group, groups, lanes

_STARTS = 2
"""Starts that an effect with a shape (a line, a speed, a number of periods) is refitted from."""
_STEP = 1e-3
"""Step of the fitted parameters' secants, in units of their magnitude."""


@dataclass(frozen=True)
class Candidate:
    """One effect's score.

    `gain` is the drop of the sum of squares (in units of the noise) that the effect promises with all fitted parameters
    re-estimated, to first order, less what its parameters cost; `share` the part of the excess over the noise floor;
    `starts` the values to begin refits from, best first.
    """

    effect: Effect
    gain: float
    share: float
    starts: tuple[dict[str, float], ...]


@partial(jax.jit, static_argnames=("robot", "integrator"))
def _lanes(robot: Robot, integrator: Integrator, numbers, changes, start, inputs, dt):
    """Simulated outputs [P, E, T, ny] for parameters `numbers` with `changes` ([P] by name) put in."""

    def one(change):
        p = {**numbers, **change}
        return jax.vmap(lambda s, u, d: rollout(robot, p, s, u, d, integrator))(start, inputs, dt)

    return jax.lax.map(one, changes, batch_size=16)


def _simulate(robot: Robot, logs: LogSet, changes: Sequence[Mapping[str, float]], states) -> NDArray[np.float64]:
    """Whitening left aside: simulated outputs [P, samples x channels] at the logs' measured places."""
    batch = logs.batch()
    base = robot.parameters.numbers
    names = sorted({name for change in changes for name in change})
    padded = list(changes) + [{}] * (-len(changes) % 16)
    columns = {name: jnp.array([change.get(name, base[name]) for change in padded]) for name in names}
    numbers = {name: jnp.asarray(value, float) for name, value in base.items()}
    outputs = _lanes(robot.structure, integrator_for(robot, logs), numbers, columns, states, batch.inputs, batch.dt)
    return np.asarray(outputs)[: len(changes)]


@in_float64
def screen(
    robot: Robot,
    logs: LogSet,
    effects: Sequence[Effect],
    noise: Mapping[str, float],
    known_states: Mapping[str, Mapping[str, float]],
) -> list[Candidate]:
    """Score `effects` on a fitted `robot` that lacks them, best first. `known_states` are estimated initial states."""
    own = list(robot.parameters.free_names)
    full = robot
    for effect in effects:
        full = full + effect
    found: list[Group] = [group for effect in effects for group in groups(effect, full, logs)]
    changes, columns = lanes(found)
    steps = [max(abs(robot.parameters[name].value), robot.parameters[name].typical or 0.0) * _STEP for name in own]
    base = robot.parameters.numbers
    secants = [{name: base[name] + step} for name, step in zip(own, steps, strict=True)]
    states = dict(initial_states(full, logs).states)
    for e, log in enumerate(logs):
        for name, value in known_states.get(log.name, {}).items():
            states[name][e] = value
    states = {name: jnp.asarray(value) for name, value in states.items()}
    outputs = _simulate(full, logs, [{}, *secants, *changes], states)
    weights, measured = _weights(logs, noise)
    residual = (np.where(weights > 0, outputs[0] - measured, 0.0) * weights).ravel()
    moved = ((outputs[1:] - outputs[0]) * weights).reshape(len(secants) + len(changes), -1)
    moved = np.where(np.all(np.isfinite(moved), axis=1, keepdims=True), moved, 0.0)
    basis = np.linalg.qr(moved[: len(own)].T)[0] if own else np.zeros((residual.size, 0))
    residual = residual - basis @ (basis.T @ residual)
    excess = max(float(residual @ residual) - np.count_nonzero(weights), 1.0)
    scored: dict[str, list[tuple[float, dict[str, float], Effect]]] = {}
    for group, mine in zip(found, columns, strict=True):
        block = moved[len(own) :][mine]
        block = block - (block @ basis) @ basis.T
        useful = np.linalg.norm(block, axis=1) > 1e-6
        if not useful.any():
            continue
        names = [name for name, ok in zip(group.strengths, useful, strict=True) if ok]
        gain, start = _promise(full, group, names, block[useful], residual)
        score = gain - len(names) * float(np.log(residual.size))
        scored.setdefault(group.effect.id, []).append((score, start, group.effect))
    candidates = []
    for tried in scored.values():
        tried.sort(key=lambda entry: -entry[0])
        starts = tuple(start for _, start, _ in tried[: _STARTS if len(tried[0][1]) > 1 else 1])
        candidates.append(Candidate(tried[0][2], tried[0][0], tried[0][0] / excess, starts))
    return sorted(candidates, key=lambda candidate: -candidate.gain)


def _promise(full: Robot, group: Group, names: list[str], block: NDArray, residual: NDArray) -> tuple[float, dict]:
    """Drop of the sum of squares to first order, and the parameters at which it is expected."""
    coefficients, *_ = np.linalg.lstsq(block.T, -residual, rcond=1e-8)
    gain = float(-coefficients @ (block @ residual))
    values = {name: float(c * group.strengths[name]) for name, c in zip(names, coefficients, strict=True)}
    # A strength that must be positive explains nothing with the wrong sign.
    if len(values) == 1 and any(value < full.parameters[name].lower for name, value in values.items()):
        gain = 0.0
    if not _proportional(group):
        # Of a limit only a size that was tried is known: the drop is that of the step as it is.
        gain = float(2 * -block[0] @ residual - block[0] @ block[0])
        return gain, {**group.shape, **dict(group.strengths)}
    return gain, {**group.shape, **{n: max(value, full.parameters[n].lower) for n, value in values.items()}}


def _proportional(group: Group) -> bool:
    """Whether the effect's size can be read off a single probe; a limit's cannot."""
    return not any(name.endswith("inverse_limit") for name in group.strengths)


def _weights(logs: LogSet, noise: Mapping[str, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """1/noise where an output was measured, and the measurements, both [E, T, ny]."""
    batch = logs.batch()
    counted = [name in logs.channels.outputs or name in ("q",) for name in batch.channels.measured]
    levels = np.array(
        [noise.get(n, np.nan) if ok else np.nan for n, ok in zip(batch.channels.measured, counted, strict=True)]
    )
    weights = np.where(np.isfinite(levels) & (levels > 0), 1.0 / np.where(levels > 0, levels, 1.0), 0.0)
    return np.where(np.asarray(batch.mask), weights, 0.0), np.asarray(batch.outputs)
