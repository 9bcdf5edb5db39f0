"""Simulations with every candidate's probes, one program for each place in the signal path.

All laws of a mechanism stand in one model, absent (zero) but for the one that a lane probes. Not all candidates do: a lane
costs what its program computes, and together they are many times the robot.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import jax
import numpy as np
from numpy.typing import NDArray

from ..._arrays import array
from ..._compile import compiled
from ...logs import LogSet
from ...robots.effect import Effect
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ...robots.traits import refusal
from ...simulation.direct import machine_model, simulated_directly
from ...simulation.integrated_angles import integrated_angles
from ...simulation.records import on_records_alone
from ...simulation.rollout import Integrator, rollout
from ...simulation.simulate import integrator_for
from ...simulation.start import initial_states
from ..refits.smoothed_angles import Angles

_SAID = 8
"""About how often it is said how far the simulations are."""
_FAR, _NEAR = 5.0, 0.1
"""What a probe may change, in units of all motion, and what it changes once its strengths are smaller."""

Pairs = Sequence[tuple[Effect, Effect]]
"""Effects as candidates have them, each with itself as it stands beside the other laws of its mechanism."""


@dataclass(frozen=True)
class Group:
    """A probe of one law and the simulated `outputs` [strengths, E, T, ny] with each of its strengths.

    `effect` is the law as candidates have it, while the probe's parameters are those of the law as it stands in `robot` beside
    the mechanism's others (`standing`).
    """

    effect: Effect
    standing: Effect
    probe: Probe
    robot: Robot
    outputs: NDArray[np.float64]

    def plain(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values by the names that the law's parameters have where it stands alone."""
        there, alone = self.standing.key(""), self.effect.key("")
        return {alone + n.removeprefix(there) if n.startswith(there) else n: value for n, value in values.items()}


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
    """Simulated outputs [P, E, T, ny] with each of the changes, at the logs' measured places."""
    batch = logs.batch()
    base = robot.parameters.numbers
    every = {name: np.array([change.get(name, value) for change in changes], float) for name, value in base.items()}
    found = simulated_directly(robot, integrator, every, states, batch.inputs, batch.dt, prescribed)
    if found is not None:
        return found
    padded = list(changes) + [{}] * (-len(changes) % 16)
    # One number at least, for lanes that change nothing: the robot as it is.
    names = sorted({name for change in changes for name in change}) or list(base)[:1]
    columns = {name: array([change.get(name, base[name]) for change in padded]) for name in names}
    numbers = {name: array(float(value)) for name, value in base.items()}
    outputs = _lanes(robot.structure, integrator, numbers, columns, states, batch.inputs, batch.dt, prescribed)
    return np.asarray(outputs)[: len(changes)]


def _begun(robot: Robot, logs: LogSet, known: Mapping[str, Mapping[str, float]]) -> dict[str, jax.Array]:
    """Initial states [E], those that were estimated put in."""
    states = dict(initial_states(robot, logs).states)
    for e, log in enumerate(logs):
        for name, value in known.get(log.name, {}).items():
            states[name][e] = value
    return {name: array(value) for name, value in states.items()}


def _begin_together(
    robot: Robot, logs: LogSet, known: Mapping[str, Mapping[str, float]]
) -> Callable[[Robot], dict[str, jax.Array]]:
    """Initial states [E] of the robot, and of it with more effects, all absent: where these have no states of their own they
    change nothing of how it begins."""
    own = _begun(robot, logs, known)
    return lambda full: own if full.states == robot.states else _begun(full, logs, known)


def _with(robot: Robot, pairs: Iterable[tuple[Effect, Effect]]) -> Robot:
    for _, standing in pairs:
        robot = robot + standing
    return robot


def _apart(robot: Robot, integrator: Integrator, pairs: Pairs) -> list[Pairs]:
    """The effects in sets, each for a program of its own: all in one where a program is XLA's and takes seconds to compile.

    Else those of one place in the signal path together. Apart are laws that act on whole records, for which the robot's own
    program serves; mechanisms that have places or angles integrated, where they are looked for in many; and those with fast
    states of their own, so that no other pays for these or for their finer steps.
    """
    names = tuple(sorted(robot.parameters))
    if machine_model(robot, names, integrator.friction) is None:
        return _admitted(robot, pairs)
    sets: dict[str, list[tuple[Effect, Effect]]] = {}
    for pair in pairs:
        sets.setdefault(_stands_with(pair[0], robot), []).append(pair)
    return [part for some in sets.values() for part in _admitted(robot, some)]


def _stands_with(effect: Effect, robot: Robot) -> str:
    """What the effects of one set of a first look have in common."""
    if on_records_alone(effect, robot):
        return f"{effect.id}:{effect.law}"
    if effect.finer > 1.0 and effect.states_on(robot):
        return f"{effect.id}, fast states"
    return effect.id if {"pose", "wheel_angles"} & set(effect.needs) else effect.where


def _admitted(robot: Robot, pairs: Pairs) -> list[Pairs]:
    """The effects in as few sets as admit each other: stamps that are early stand beside nothing that comes late."""
    sets: list[list[tuple[Effect, Effect]]] = []
    full: list[Robot] = []
    for pair in pairs:
        standing = pair[1]
        place = next((i for i, there in enumerate(full) if refusal(standing, there) is None), len(sets))
        if place == len(sets):
            sets.append([])
            full.append(robot)
        sets[place].append(pair)
        full[place] = full[place] + standing
    return list(sets)


def _changes_of(probes: Sequence[tuple[Effect, Effect, Probe]]) -> list[dict[str, float]]:
    """What each lane changes: one strength, with the shape that it has."""
    return [{**probe.shape, name: value} for *_, probe in probes for name, value in probe.strengths.items()]


def _no_farther(
    probes: list[tuple[Effect, Effect, Probe]],
    outputs: NDArray[np.float64],
    plain: NDArray[np.float64],
    simulate: Callable[[Sequence[Mapping[str, float]]], NDArray[np.float64]],
) -> tuple[list[tuple[Effect, Effect, Probe]], NDArray[np.float64]]:
    """The probes and their `outputs` [P, E, T, ny], those that move the robot far more than all that drove it with smaller
    strengths: what is typical of a force is a guess where a robot of one's own has units of its own, and nothing is
    proportional there."""
    size = np.sqrt(np.nanmean(np.square(plain - plain.mean(axis=1, keepdims=True)), axis=(0, 1)))
    moves = size > 0
    if not moves.any():
        return probes, outputs
    far = (outputs[..., moves] - plain[..., moves]) / size[moves]
    with np.errstate(over="ignore", invalid="ignore"):
        beyond = np.sqrt(np.nanmean(np.square(far), axis=(1, 2, 3)))
    found, places, at = list(probes), list[int](), 0
    for i, (alone, there, probe) in enumerate(probes):
        own = range(at, at + len(probe.strengths))
        at = own.stop
        most = max(beyond[k] for k in own)
        if not probe.limits and _FAR < most < np.inf:
            smaller = {name: value * _NEAR / most for name, value in probe.strengths.items()}
            found[i] = alone, there, replace(probe, strengths=smaller)
            places += own
    if places:
        changes = _changes_of(found)
        outputs = outputs.copy()
        outputs[places] = simulate([changes[k] for k in places])
    return found, outputs


def probed(
    robot: Robot,
    logs: LogSet,
    pairs: Pairs,
    secants: Sequence[Mapping[str, float]],
    seen: Seen,
    known_states: Mapping[str, Mapping[str, float]],
    angles: Angles | None,
    report: Callable[[str], None] = lambda message: None,
) -> tuple[NDArray[np.float64], list[Group], list[list[int]], dict]:
    """Simulated outputs of the `robot` as it is and with each of `secants` [1 + secants, E, T, ny]; the probes of all effects
    with theirs; the places of each group's outputs among those of all groups; and the wheels' angles that were prescribed.

    `report` is called after each program."""
    integrator = integrator_for(robot, logs)
    columns = {str(name) for log in logs for name in log.extra.columns}
    pairs = [pair for pair in pairs if pair[0].first_look and columns >= set(pair[0].from_columns)]
    own = dict(angles or integrated_angles(robot, logs))
    begin = _begin_together(robot, logs, known_states)
    first = _simulate(robot, integrator, logs, [{}, *secants], begin(robot), own)
    found: list[Group] = []
    places: list[list[int]] = []
    prescribed, count = dict(own), 0
    sets = _apart(robot, integrator, pairs)
    for number, some in enumerate(sets, start=1):
        full = _with(robot, some)
        probes = [(alone, there, probe) for alone, there in some for probe in there.probes(full.alone, seen)]
        changes = _changes_of(probes)
        if not changes:
            continue
        fixed = dict(angles or integrated_angles(full, logs))
        prescribed |= fixed
        begun = begin(full)
        steps = integrator
        outputs = _simulate(full, steps, logs, changes, begun, fixed)
        if not np.all(np.isfinite(outputs)) and (finer := integrator_for(full, logs)).substeps > steps.substeps:
            # A state of one effect that the robot's own steps do not follow spoils what stands beside it.
            steps = finer
            outputs = _simulate(full, steps, logs, changes, begun, fixed)
        simulate = partial(_simulate, full, steps, logs, states=begun, prescribed=fixed)
        probes, outputs = _no_farther(probes, outputs, first[0], simulate)
        at = 0
        for alone, there, probe in probes:
            n = len(probe.strengths)
            found.append(Group(alone, there, probe, full, outputs[at : at + n]))
            places.append(list(range(count, count + n)))
            at, count = at + n, count + n
        if number % max(1, len(sets) // _SAID) == 0 or number == len(sets):
            report(f"simulated with what may be missing: {number} of {len(sets)} groups of effects")
    return first, found, places, prescribed
