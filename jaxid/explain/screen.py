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
from ..effects import catalogue
from ..estimate.result import Fit
from ..logs import LogSet, noise_level
from ..robots.effect import Effect
from ..robots.robot import Robot
from ..simulate.rollout import Integrator, rollout
from ..simulate.simulate import integrator_for
from ..simulate.start import initial_states
from .probes import Group, groups, lanes

_STEP = 1e-3
"""Step of the fitted parameters' secants, in units of their magnitude."""


@dataclass(frozen=True)
class Candidate:
    """One effect's score.

    `gain` is the drop of the sum of squares (in units of the noise) that the effect promises with all fitted parameters
    re-estimated, to first order; `share` the part of the excess over the noise floor; `start` the values to begin a
    refit from.
    """

    effect: Effect
    gain: float
    share: float
    start: dict[str, float]


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
def screen(fit: Fit, logs: LogSet, effects: Sequence[Effect] | None = None) -> list[Candidate]:
    """Score every effect of the catalogue (or of `effects`) that `fit.robot` lacks, best first."""
    robot = fit.robot
    own = list(robot.parameters.free_names)
    candidates = list(catalogue(robot) if effects is None else effects)
    full = robot
    for effect in candidates:
        full = full + effect
    found: list[Group] = [group for effect in candidates for group in groups(effect, full, logs)]
    changes, columns = lanes(found)
    steps = [max(abs(fit.parameters[name].value), robot.parameters[name].typical or 0.0) * _STEP for name in own]
    base = robot.parameters.numbers
    secants = [{name: base[name] + step} for name, step in zip(own, steps, strict=True)]
    states = dict(initial_states(full, logs).states)
    for e, log in enumerate(logs):
        for name, value in fit.initial_states.get(log.name, {}).items():
            states[name][e] = value
    states = {name: jnp.asarray(value) for name, value in states.items()}
    outputs = _simulate(full, logs, [{}, *secants, *changes], states)
    weights, measured = _weights(logs)
    residual = (np.where(weights > 0, outputs[0] - measured, 0.0) * weights).ravel()
    moved = ((outputs[1:] - outputs[0]) * weights).reshape(len(secants) + len(changes), -1)
    moved = np.where(np.all(np.isfinite(moved), axis=1, keepdims=True), moved, 0.0)
    basis = np.linalg.qr(moved[: len(own)].T)[0] if own else np.zeros((residual.size, 0))
    residual = residual - basis @ (basis.T @ residual)
    excess = max(float(residual @ residual) - np.count_nonzero(weights), 1.0)
    best: dict[str, Candidate] = {}
    for group, mine in zip(found, columns, strict=True):
        block = moved[len(own) :][mine]
        block = block - (block @ basis) @ basis.T
        size = np.linalg.norm(block, axis=1)
        useful = size > 1e-6
        if not useful.any():
            continue
        coefficients, *_ = np.linalg.lstsq(block[useful].T, -residual, rcond=1e-8)
        gain = float(-coefficients @ (block[useful] @ residual))
        names = [name for name, ok in zip(group.strengths, useful, strict=True) if ok]
        values = {name: float(c * group.strengths[name]) for name, c in zip(names, coefficients, strict=True)}
        # A strength that must be positive explains nothing with the wrong sign.
        wrong = [name for name, value in values.items() if value < full.parameters[name].lower]
        if wrong and len(values) == 1:
            gain = 0.0
        start = {**group.shape, **{name: max(value, full.parameters[name].lower) for name, value in values.items()}}
        if _proportional(group) is False:
            start = {**group.shape, **dict(group.strengths)}
        score = gain - len(values) * np.log(residual.size)
        candidate = Candidate(group.effect, score, score / excess, start)
        if group.effect.id not in best or score > best[group.effect.id].gain:
            best[group.effect.id] = candidate
    return sorted(best.values(), key=lambda candidate: -candidate.gain)


def _proportional(group: Group) -> bool:
    """Whether the effect's size can be read off a single probe; a limit's cannot."""
    return not any(name.endswith("inverse_limit") for name in group.strengths)


def _weights(logs: LogSet) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """1/noise where an output was measured, and the measurements, both [E, T, ny]; noise as the data themselves show it."""
    batch = logs.batch()
    noise = noise_level(logs)
    levels = np.array([noise[name] if name in logs[0].channels.outputs else np.inf for name in batch.channels.measured])
    levels = np.where(np.isfinite(levels), levels, np.inf)
    return np.where(np.asarray(batch.mask), 1.0 / levels, 0.0), np.asarray(batch.outputs)
