"""Forces that a linear fit lacks: the score test of `output_error/neglected.py`, of the motion that the estimate makes.

Equations over short stretches lose what is slow, so that a drag or a rise of friction towards standstill can move every
parameter by many standard errors and leave equations that look like noise. What the estimate simulates of whole logs shows it,
after what the parameters could still take up: a linear fit is no minimum of the simulation's error. Derivatives are
differences of simulations, over a standard error of each parameter.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._distributions import student_tail
from ...logs import LogSet
from ...robots.robot import Robot
from ...simulation.simulate import integrator_for, simulate, simulate_models
from ...simulation.start import initial_states
from ..confidence.agreement import errors_of, rms
from ..lacking import Neglected, probed, words_of
from ..residual_tests import FALSE_ALARM, whiteness
from .score_covariance import score_covariance

Array = NDArray[np.float64]
Outputs = Sequence[Array]
_FINER = 4
"""Factor by which steps are shorter than those that suit the robot."""
_FELT, _TRIES = 0.3, 8
"""Change of the simulation (RMS, times the noise) by a step of a derivative, and how often its length is corrected."""
_OWN = 1e-3
"""Share of a direction that must be its own, beside what parameters and initial states do."""
_NEAR, _FAR = 2.0, 10.0
"""What is left, in units of the noise, up to which a change of the parameters to first order is said, and anything at all."""
_FEWEST = 30
"""Samples, less what is fitted to them, below which nothing is asked."""


@dataclass(frozen=True)
class _Rows:
    """Measured samples of all channels of all logs, one after the other: their `log`, `channel`, and `sample` among those of
    all logs [samples]."""

    log: NDArray[np.int64]
    channel: NDArray[np.int64]
    sample: NDArray[np.int64]

    @staticmethod
    def of(logs: LogSet) -> "_Rows":
        found, before = [], 0
        for e, log in enumerate(logs):
            for name, error in errors_of(log, np.zeros_like(log.outputs)).items():
                there = np.flatnonzero(np.isfinite(error))
                places = np.full(len(there), e), np.full(len(there), log.channels.measured.index(name)), there + before
                found.append(np.stack(places))
            before += len(log)
        return _Rows(*np.concatenate(found, axis=1))

    def parts(self, values: Array) -> dict[int, list[Array]]:
        """`values` [samples] by channel and log."""
        return {
            int(c): [values[(self.channel == c) & (self.log == e)] for e in np.unique(self.log[self.channel == c])]
            for c in np.unique(self.channel)
        }


class _Asked(NamedTuple):
    """What is `left` (RMS, times the noise) beside all that the parameters do, and, of each force, by unit directions in units
    of what is left: `scores` and their standard `deviations` with so much `freedom`, `lengths` of the directions, and what of
    the parameters' columns goes with each, `onto` (zero where that says nothing)."""

    left: float
    scores: Array
    deviations: Array
    freedom: float
    lengths: Array
    onto: Array


def _scaled(logs: LogSet, outputs: Outputs, noise: Mapping[str, float]) -> Array:
    """Simulated minus measured in units of the `noise` [samples], as `_Rows` has them."""
    parts = [error / noise[c] for log, y in zip(logs, outputs, strict=True) for c, error in errors_of(log, y).items()]
    measured = [np.isfinite(e) for log in logs for e in errors_of(log, np.zeros_like(log.outputs)).values()]
    return np.concatenate([part[there] for part, there in zip(parts, measured, strict=True)])


def _felt(simulated: Callable[[Array], list[Array]], here: Array, count: int) -> dict[int, Array]:
    """Derivatives [samples] by number, of `count` things of no known size, whose steps [count] `simulated` turns into
    residuals; without those that change nothing or whatever they do is not finite."""
    steps, found, done = np.ones(count), {}, np.zeros(count, bool)
    for _ in range(_TRIES if count else 0):
        changes = [there - here for there in simulated(steps)]
        sizes = np.array([rms(change) if np.isfinite(change).all() else np.inf for change in changes])
        found = {k: c / steps[k] for k, c in enumerate(changes) if 0.0 < sizes[k] < np.inf}
        done = (sizes > 0.1 * _FELT) & (sizes < 3.0 * _FELT) | (sizes == 0.0)
        if done.all():
            break
        change = np.where(np.isfinite(sizes), _FELT / np.maximum(sizes, 1e-9), 1e-6)
        steps = np.where(done, steps, steps * change)
    return {k: own for k, own in found.items() if done[k]}


def neglected(
    robot: Robot, logs: LogSet, errors: Mapping[str, float], noise: Mapping[str, float], memory: int
) -> Neglected | None:
    """What the free simulation of `robot`, which has the estimates, most plainly asks for.

    `errors`: standard errors of the parameters that were estimated, within their bounds; `noise` of each channel; `memory`:
    samples after which the motion has half forgotten. None where nothing can be asked: of a controlled robot, and where the
    simulation does not follow the logs.
    """
    if robot.controlled:
        return None
    wide, added = probed(robot, logs)
    begin = initial_states(wide, logs)
    steps = replace(integrator_for(wide, logs), substeps=_FINER * integrator_for(wide, logs).substeps)

    def changed(values: Mapping[str, float]) -> Robot:
        """With parameters changed by `values`, or by as much of them as their bounds allow."""
        table = wide.parameters
        return wide.with_values(**{n: table[n].inside(table[n].value + by) for n, by in values.items()})

    def simulated(robots: Sequence[Robot]) -> list[Array]:
        by_log = simulate_models(robots, logs, start=begin.states, integrator=steps)
        return [_scaled(logs, [y[k] for y in by_log], noise) for k in range(len(robots))]

    names = list(errors)
    either = [changed({name: sign * errors[name]}) for name in names for sign in (1.0, -1.0)]
    here, *others = simulated([wide, *either])
    coarse = _scaled(logs, simulate(wide, logs, start=begin.states, integrator=integrator_for(wide, logs)), noise)
    if not all(np.isfinite(y).all() for y in (here, coarse, *others)):
        return None
    spans = [
        up.parameters[n].value - down.parameters[n].value
        for n, up, down in zip(names, either[::2], either[1::2], strict=True)
    ]
    columns = [
        (up - down) * errors[name] / max(span, 1e-300)
        for name, span, up, down in zip(names, spans, others[::2], others[1::2], strict=True)
    ]
    forces = _felt(
        lambda by: simulated([changed({n: float(s)}) for n, s in zip(added, by, strict=True)]), here, len(added)
    )

    def moved(by: Array) -> list[Array]:
        """Residuals after each state of the logs that start in motion is changed."""
        there = []
        for name, step in zip(wide.estimated_states, by, strict=True):
            start = {**begin.states, name: begin.states[name] + step * begin.uncertain}
            there.append(_scaled(logs, simulate(wide, logs, start=start, integrator=steps), noise))
        return there

    starts = _felt(moved, here, len(wide.estimated_states) * bool(begin.uncertain.any()))
    rows = _Rows.of(logs)
    columns += [np.where(rows.log == e, c, 0.0) for c in starts.values() for e in np.flatnonzero(begin.uncertain)]
    kept = list(forces)
    own = np.column_stack(columns) if columns else np.zeros((len(here), 0))
    if not kept or len(here) - own.shape[1] - len(kept) < _FEWEST:
        return None
    lengths = np.array([len(log) for log in logs])
    asked = _asked(rows, lengths, here, own, np.column_stack([forces[k] for k in kept]), memory)
    if asked is None:
        return None
    # What the integration gets wrong may lie along any one direction.
    wrong = rms(here - coarse) / (_FINER - 1) * np.sqrt(len(here)) / asked.left
    z = np.maximum(np.abs(asked.scores) - wrong, 0.0) / asked.deviations
    best = int(np.argmax(z))
    p = min(2.0 * float(student_tail(z[best], asked.freedom)) * len(kept), 1.0)
    by = asked.onto[: len(names), best] * asked.scores[best] / max(asked.lengths[best], 1e-300)
    shift = {name: float(own * errors[name]) for name, own in zip(names, by, strict=True)}
    every = np.array([shift.get(name, 0.0) for name in robot.parameters.free_names])
    return Neglected(words_of(added[kept[best]]), float(z[best]), p, every)


def _asked(
    rows: _Rows, lengths: NDArray[np.int64], residual: Array, own: Array, forces: Array, memory: int
) -> _Asked | None:
    """What the `residual` [samples] asks of the `forces` [samples, m] beside its `own` columns [samples, n]; `lengths` [E] of
    the logs. None where what is left is far more than noise."""
    size = np.linalg.norm(own, axis=0)
    own = own / np.where(size > 0, size, 1.0)
    every = np.column_stack([forces, residual])
    first = residual - own @ np.linalg.lstsq(own, residual, rcond=1e-10)[0]
    left = rms(first)
    if not left < _FAR:
        return None
    levels = {c: max(rms(np.concatenate(parts)), 1e-300) for c, parts in rows.parts(first).items()}
    weight = 1.0 / np.array([levels[int(c)] for c in rows.channel])
    own, every = own * weight[:, None], every * weight[:, None]
    onto = np.linalg.lstsq(own, every, rcond=1e-10)[0]
    beside = every - own @ onto
    norms = np.linalg.norm(beside[:, :-1], axis=0)
    told = norms > _OWN * np.linalg.norm(every[:, :-1], axis=0)
    unit = np.where(told, beside[:, :-1] / np.where(norms > 0, norms, 1.0), 0.0)
    products = unit * beside[:, -1:]
    deviations, freedom = np.ones(unit.shape[1]), float(len(residual) - own.shape[1] - unit.shape[1])

    def coloured(values: Array) -> bool:
        return min(whiteness(parts).p_value for parts in rows.parts(values).values()) < FALSE_ALARM

    scores = products.sum(axis=0)
    best = int(np.argmax(np.abs(scores)))
    # A force colours what it leaves: that is no noise's colour if nothing of it is left without the force.
    if coloured(beside[:, -1]) and coloured(beside[:, -1] - unit[:, best] * scores[best]):
        by_sample, log = np.zeros((int(lengths.sum()), unit.shape[1])), np.repeat(np.arange(len(lengths)), lengths)
        np.add.at(by_sample, rows.sample, products)
        each = [score_covariance(by_sample[:, j : j + 1], log, memory) for j in range(unit.shape[1])]
        deviations = np.sqrt([max(float(variance[0, 0]), 1.0) for variance, _ in each])
        freedom = min(degrees for _, degrees in each)
        if freedom <= 0:
            return None
    back = onto[:, :-1] / np.where(size > 0, size, np.inf)[:, None] * (left < _NEAR)
    return _Asked(left, scores, deviations, freedom, norms, back)
