"""What each candidate would change of the logs, to first order: outputs per unit of its coordinates."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...effects import laws_of
from ...effects.actuator.motor_strength import OfEach
from ...effects.curve import SHAPE
from ...effects.effect_parameters import PER_AXIS
from ...effects.sensor.delay import SensorDelayOfEach
from ...effects.sensor.lag import SensorLagOfEach
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..screening.probed import probed
from ..screening.probes import seen_in, standing_together
from .candidates import Candidate, Side, mechanisms_of, of_mechanism
from .joint import SIDES, STEP, Pair, numbers_on

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Changes:
    """A candidate's changes [k, E, T, ny] of its side, one coordinate each, per unit of `sizes`; a strength that must be
    positive."""

    candidate: Candidate
    outputs: Array
    sizes: Array
    positive: bool = False


def _of_own(pair: Pair) -> tuple[dict[Side, Array], list[Changes]]:
    """Outputs [1 + n, E, T, ny] of both sides as they are and per magnitude of the shared parameters, and the changes of all
    candidates but the catalogue's mechanisms."""
    candidates, robot = pair.own, pair.robot
    theta = np.array([robot.parameters[n].value for n in pair.free])
    shared: dict[Side, Array] = {}
    found: list[Changes] = []

    def lane(side: Side, candidate: Candidate | None, i: int, k: int) -> tuple[dict[str, float], float]:
        """The numbers with one coordinate (of `candidate`, k in all; else the i-th shared parameter) moved away from its bound,
        and the share of its magnitude by which it is moved."""
        here = numbers_on(side, robot, pair.free, candidate, theta, np.zeros(k))
        for step in (STEP, -STEP):
            t, d = theta.copy(), np.zeros(k)
            if candidate is None:
                t[i] += step * sizes[i]
            else:
                d[i] = step * candidate.coordinates[i].size
            there = numbers_on(side, robot, pair.free, candidate, t, d)
            if there != here:
                return there, step
        return here, STEP

    sizes = pair.sizes()
    for side in SIDES:
        own = pair.sides[side]
        lanes = [lane(side, None, i, 0) for i in range(len(theta))]
        mine = candidates if side == "after" else ()
        lanes += [lane(side, c, i, len(c.coordinates)) for c in mine for i in range(len(c.coordinates))]
        outputs = own.simulated(robot, [{}, *(numbers for numbers, _ in lanes)], own.nothing_moved)
        moved = (outputs[1:] - outputs[0]) / np.array([step for _, step in lanes])[:, None, None, None]
        shared[side] = np.concatenate([outputs[:1], moved[: len(theta)]])
        at = len(theta)
        for candidate in mine:
            k = len(candidate.coordinates)
            found.append(Changes(candidate, moved[at : at + k], np.array([c.size for c in candidate.coordinates])))
            at += k
    return shared, found


def _another_change(law: Effect, usual: Effect) -> bool:
    """Whether a law is another thing that may happen, and not another formula of the usual one's: it acts on inputs that do not
    drive, which the usual one leaves alone, it is of another part of a motor (driver, magnets, winding), or of one sensor or
    one drive axis of several."""
    one_of_them = type(law) in (SensorLagOfEach, SensorDelayOfEach) or law.law == PER_AXIS
    return ("steered" in law.needs and "steered" not in usual.needs) or isinstance(law, OfEach) or one_of_them


def _of_mechanisms(
    robot: Robot,
    pair: Pair,
    known: Mapping[Side, Mapping[str, Mapping[str, float]]],
    report: Callable[[str], None],
) -> list[Changes]:
    """The changes that mechanisms of the catalogue make where they appear or vanish: by their usual law, those laws that are
    another change, and their curve."""
    effects: list[Effect] = []
    for usual in mechanisms_of(robot):
        laws = laws_of(robot, usual.id)
        effects += [laws[0].blurred, *(law for law in laws[1:] if law.law == SHAPE or _another_change(law, laws[0]))]
    found: list[Changes] = []
    if not effects:
        return found
    for side in SIDES:
        own = pair.sides[side]
        noise = dict(zip(own.logs.channels.measured, map(float, own.sigma), strict=True))
        seen = seen_in(robot, own.logs, noise, known[side], None)
        first, groups, _, _ = probed(robot, own.logs, standing_together(effects), [], seen, known[side], None, report)
        for group in groups:
            strengths = group.plain(group.probe.strengths)
            values = {**group.plain(group.probe.shape), **strengths}
            candidate = of_mechanism(group.effect, robot, side, values)
            names = [c.name for c in candidate.coordinates]
            moved = np.nan_to_num((group.outputs - first[0]) / own.sigma, posinf=0.0, neginf=0.0)
            moved = np.where(own.there, moved, 0.0)
            whole = np.zeros((len(names), *moved.shape[1:]))
            whole[[names.index(name) for name in strengths]] = moved
            sizes = np.array([strengths.get(name, np.nan) for name in names])
            positive = len(strengths) == 1 and group.robot.parameters[next(iter(group.probe.strengths))].lower >= 0.0
            found.append(Changes(candidate, whole, sizes, positive))
    return found


@dataclass(frozen=True)
class Linear:
    """All that may move, to first order: `residual` [E, T, ny] of each side at the first fit's numbers, `columns` [n, E, T, ny]
    of the shared parameters, `states` [s, E, T, ny] of initial states, and the `changes` of all candidates."""

    pair: Pair
    residual: dict[Side, Array]
    columns: dict[Side, Array]
    states: dict[Side, Array]
    changes: tuple[Changes, ...]


def all_that_may_move(
    robot: Robot,
    pair: Pair,
    known: Mapping[Side, Mapping[str, Mapping[str, float]]],
    report: Callable[[str], None],
) -> Linear:
    """Both sets simulated at the numbers of `robot`, the first fit's, and with everything moved. `known` are the estimated
    initial states of each side's logs by name; `report` is told how far the simulations are."""
    shared, changes = _of_own(pair)
    report("simulated with changes of the robot's own parameters")
    changes += _of_mechanisms(robot, pair, known, report)
    residual, columns, states = dict[Side, Array](), dict[Side, Array](), dict[Side, Array]()
    for side in SIDES:
        own, now = pair.sides[side], shared[side][0]
        residual[side], columns[side] = now - own.observed, shared[side][1:]
        states[side] = np.moveaxis(own.state_columns(pair.robot, own.nothing_moved, now), -1, 0)
    return Linear(pair, residual, columns, states, tuple(changes))
